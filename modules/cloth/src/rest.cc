#include "semblance/cloth/rest.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "semblance/core/errors.h"

namespace semblance {

RestReport settle(ClothSystem& system, ClothState& state, const RestOptions& options,
                  Progress& progress) {
  RestReport report;
  double step_s = options.first_step_s;
  system.options().linear_tolerance = options.linear_tolerance;
  system.options().motion_tolerance = options.motion_tolerance;
  system.options().most_newton_iterations = options.most_newton_iterations;
  if (options.pace) {
    step_s = options.pace->step_s;
    system.options().tolerance = options.pace->tolerance;
  }
  progress.begin("rest", 0);
  while (report.steps < options.most_steps && !progress.cancelled()) {
    const StepReport step = system.step(state, step_s);
    progress.update(++report.steps);
    report.newton_iterations += step.newton_iterations;
    report.linear_iterations += step.linear_iterations;
    report.step_solved = step.solved;
    report.residual = system.rest_residual(state);
    report.at_rest = report.residual <= options.tolerance;
    if (step.solved) {
      step_s = std::min(2.0 * step_s, options.longest_step_s);
    } else if (step.residual > 1.0) {
      step_s = std::max(0.5 * step_s, options.first_step_s);
    }
    system.options().tolerance = std::clamp(0.1 * report.residual, 0.5 * options.tolerance, 0.01);
    if (options.after_step) options.after_step(state, report, {step_s, system.options().tolerance});
    if (report.at_rest) break;
  }
  progress.end();
  return report;
}

namespace {

/// Barycentric coordinates of p in triangle t of the sheet's plane.
Eigen::Vector3d barycentric(const Sheet& sheet, int t, const Eigen::Vector2d& p) {
  const Eigen::Vector2d a = sheet.material_m.row(sheet.triangles(t, 0));
  Eigen::Matrix2d e;
  e.col(0) = sheet.material_m.row(sheet.triangles(t, 1)).transpose() - a;
  e.col(1) = sheet.material_m.row(sheet.triangles(t, 2)).transpose() - a;
  const Eigen::Vector2d s = e.inverse() * (p - a);
  return {1.0 - s.sum(), s[0], s[1]};
}

/// Finds the triangle of a sheet's plane around a point, by bins.
class TriangleSearch {
 public:
  explicit TriangleSearch(const Sheet& sheet) : sheet_(sheet) {
    low_ = sheet.material_m.colwise().minCoeff();
    const Eigen::Vector2d size =
        sheet.material_m.colwise().maxCoeff().transpose() - low_.transpose();
    bin_m_ = std::max(1e-9, 2.0 * std::sqrt(size.prod() / sheet.triangles.rows()));
    columns_ = static_cast<int>(size[0] / bin_m_) + 1;
    rows_ = static_cast<int>(size[1] / bin_m_) + 1;
    bins_.resize(static_cast<std::size_t>(columns_) * rows_);
    for (int t = 0; t < sheet.triangles.rows(); ++t) {
      Eigen::Array2i first(columns_, rows_), last(0, 0);
      for (int k = 0; k < 3; ++k) {
        const Eigen::Array2i at = bin(sheet.material_m.row(sheet.triangles(t, k)));
        first = first.min(at);
        last = last.max(at);
      }
      for (int j = first[1]; j <= last[1]; ++j) {
        for (int i = first[0]; i <= last[0]; ++i) bins_[index(i, j)].push_back(t);
      }
    }
  }

  /// The triangle and the weights; the nearest one for points just outside.
  std::pair<int, Eigen::Vector3d> find(const Eigen::Vector2d& p) const {
    const Eigen::Array2i at = bin(p);
    std::pair<int, Eigen::Vector3d> best{-1, Eigen::Vector3d::Zero()};
    double inside = -1e300;
    for (int j = std::max(0, at[1] - 1); j <= std::min(rows_ - 1, at[1] + 1); ++j) {
      for (int i = std::max(0, at[0] - 1); i <= std::min(columns_ - 1, at[0] + 1); ++i) {
        for (const int t : bins_[index(i, j)]) {
          const Eigen::Vector3d w = barycentric(sheet_, t, p);
          if (w.minCoeff() > inside) {
            inside = w.minCoeff();
            best = {t, w};
          }
        }
      }
    }
    return best;
  }

 private:
  Eigen::Array2i bin(const Eigen::Vector2d& p) const {
    const Eigen::Vector2d at = (p.transpose() - low_).transpose() / bin_m_;
    return {std::clamp(static_cast<int>(at[0]), 0, columns_ - 1),
            std::clamp(static_cast<int>(at[1]), 0, rows_ - 1)};
  }
  std::size_t index(int i, int j) const { return static_cast<std::size_t>(j) * columns_ + i; }

  const Sheet& sheet_;
  Eigen::RowVector2d low_;
  double bin_m_;
  int columns_, rows_;
  std::vector<std::vector<int>> bins_;
};

}  // namespace

Points refine(const Sheet& coarse, const Points& positions_m, const Sheet& fine) {
  const TriangleSearch search(coarse);
  Points out(fine.vertex_count(), 3);
  for (Eigen::Index v = 0; v < fine.vertex_count(); ++v) {
    const auto [t, w] = search.find(fine.material_m.row(v));
    if (t < 0)
      throw InvalidInput("refine: the two sheets do not cover the same part of the fabric");
    out.row(v) = w[0] * positions_m.row(coarse.triangles(t, 0)) +
                 w[1] * positions_m.row(coarse.triangles(t, 1)) +
                 w[2] * positions_m.row(coarse.triangles(t, 2));
  }
  return out;
}

}  // namespace semblance
