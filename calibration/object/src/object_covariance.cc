#include "object_covariance.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace semblance {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kCells = 8;  // to each side of the object's box in the picture
// Of all of a picture alike, in pixels of the comparison.
constexpr float kOutlineOffset_px = 0.25f;
constexpr double kColourOffset_px = 0.2;

/// Which cell of the visible object's box a place is in.
class CellGrid {
 public:
  explicit CellGrid(const Synthesis& synthesis) {
    const int width = synthesis.camera.width;
    low_ = {width, synthesis.camera.height};
    for (const std::int32_t pixel : synthesis.pixels.pixel) {
      const Eigen::Vector2i at(pixel % width, pixel / width);
      low_ = low_.cwiseMin(at);
      high_ = high_.cwiseMax(at);
    }
  }
  std::size_t cell_of(double x_px, double y_px) const {
    const auto part = [](double at, int low, int high) {
      const double share = (at - low) / std::max(high + 1 - low, 1);
      return std::clamp(static_cast<int>(share * kCells), 0, kCells - 1);
    };
    return static_cast<std::size_t>(part(y_px, low_.y(), high_.y()) * kCells +
                                    part(x_px, low_.x(), high_.x()));
  }

 private:
  Eigen::Vector2i low_, high_ = Eigen::Vector2i::Zero();
};

std::vector<int> cells_of_pixels(const Synthesis& synthesis, const CellGrid& grid) {
  const int width = synthesis.camera.width;
  std::vector<int> out;
  for (const std::int32_t pixel : synthesis.pixels.pixel) {
    out.push_back(static_cast<int>(grid.cell_of(pixel % width, pixel / width)));
  }
  return out;
}

std::vector<std::vector<ContourTarget>> outline_by_cell(const std::vector<ContourTarget>& outline,
                                                        const CellGrid& grid) {
  std::vector<std::vector<ContourTarget>> out(kCells * kCells);
  for (const ContourTarget& target : outline) {
    out[grid.cell_of(target.target_px.x(), target.target_px.y())].push_back(target);
  }
  return out;
}

class Scatter {
 public:
  Scatter(const ObjectWorkspace& workspace, const ObjectObjective& objective, const VectorXd& x)
      : workspace_(workspace), objective_(objective), x_(x) {}

  /// Adds a picture's share of the gradient's covariance to `out`.
  void add(std::size_t picture, const PictureComparison& comparison, MatrixXd& out) const {
    const std::vector<int> columns = objective_.columns(picture);
    const auto size = static_cast<Eigen::Index>(columns.size());
    MatrixXd sum = MatrixXd::Zero(size, size);
    objective_.with_synthesis(x_, picture, [&](const Synthesis& synthesis) {
      add_cells(picture, comparison, synthesis, sum);
      add_offset(picture, comparison, synthesis, sum);
    });
    out(columns, columns) += sum;
  }

 private:
  VectorXd gradient(std::size_t picture, const Synthesis& synthesis,
                    std::vector<ContourTarget> outline) const {
    NormalEquations equations;
    equations.reset(static_cast<Eigen::Index>(objective_.columns(picture).size()));
    const ContourCost cost(std::move(outline), &workspace_.target().topology);
    objective_.add_cost(x_, picture, synthesis, cost, equations);
    return equations.gradient;
  }

  void add_cells(std::size_t picture, const PictureComparison& comparison,
                 const Synthesis& synthesis, MatrixXd& sum) const {
    const CellGrid grid(synthesis);
    MatrixXd scores = MatrixXd::Zero(sum.rows(), kCells * kCells);
    if (comparison.colours != nullptr) {
      const auto found = comparison.colours->scores(objective_.view(x_, picture), synthesis,
                                                    cells_of_pixels(synthesis, grid),
                                                    kCells * kCells, kColourOffset_px);
      scores += found.cells;
      sum += found.systematic * found.systematic.transpose();
    }
    const auto outline = outline_by_cell(comparison.outline, grid);
    for (std::size_t cell = 0; cell < outline.size(); ++cell) {
      if (outline[cell].empty()) continue;
      scores.col(static_cast<Eigen::Index>(cell)) += gradient(picture, synthesis, outline[cell]);
    }
    // As many cells less than there are as the parameters can satisfy.
    const auto used = static_cast<double>((scores.colwise().squaredNorm().array() > 0.0).count());
    const double left = std::max(1.0, used - static_cast<double>(sum.rows()));
    sum += used / left * scores * scores.transpose();
  }

  void add_offset(std::size_t picture, const PictureComparison& comparison,
                  const Synthesis& synthesis, MatrixXd& sum) const {
    if (comparison.outline.empty()) return;
    std::vector<ContourTarget> moved = comparison.outline;
    for (ContourTarget& target : moved) target.target_px += kOutlineOffset_px * target.normal;
    const VectorXd g = gradient(picture, synthesis, std::move(moved)) -
                       gradient(picture, synthesis, comparison.outline);
    sum += g * g.transpose();
  }

  const ObjectWorkspace& workspace_;
  const ObjectObjective& objective_;
  const VectorXd& x_;
};

}  // namespace

std::optional<MatrixXd> inverse_of_normal(const MatrixXd& hessian) {
  const VectorXd scale = hessian.diagonal().cwiseSqrt().cwiseInverse();
  if (!scale.allFinite()) return std::nullopt;
  const MatrixXd scaled = scale.asDiagonal() * hessian * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(scaled);
  constexpr double least_eigenvalue = 1e-10;
  if (!(solver.eigenvalues()[0] > least_eigenvalue)) return std::nullopt;
  const MatrixXd inverse = solver.eigenvectors() *
                           solver.eigenvalues().cwiseInverse().asDiagonal() *
                           solver.eigenvectors().transpose();
  return scale.asDiagonal() * inverse * scale.asDiagonal();
}

std::optional<MatrixXd> comparison_covariance(const ObjectWorkspace& workspace,
                                              const ObjectObjective& objective, const VectorXd& x,
                                              const std::vector<PictureComparison>& comparisons) {
  NormalEquations all;
  if (!objective.normal_equations(x, all)) return std::nullopt;
  const auto inverse = inverse_of_normal(all.hessian);
  if (!inverse) return std::nullopt;
  MatrixXd scatter = objective.pairs_information(x);
  const Scatter cells(workspace, objective, x);
  for (std::size_t k = 0; k < comparisons.size(); ++k) cells.add(k, comparisons[k], scatter);
  return *inverse * scatter * *inverse;
}

}  // namespace semblance
