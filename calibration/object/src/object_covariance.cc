#include "object_covariance.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace semblance {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kCells = 8;                   // to each side of the object's box in the picture
constexpr float kOutlineOffset_px = 0.25f;  // of all of an outline alike

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

std::vector<VisiblePixels> pixels_by_cell(const Synthesis& synthesis, const CellGrid& grid) {
  std::vector<VisiblePixels> out(kCells * kCells);
  const VisiblePixels& all = synthesis.pixels;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const int x = all.pixel[i] % synthesis.camera.width, y = all.pixel[i] / synthesis.camera.width;
    VisiblePixels& cell = out[grid.cell_of(x, y)];
    cell.pixel.push_back(all.pixel[i]);
    cell.triangle.push_back(all.triangle[i]);
    cell.b1.push_back(all.b1[i]);
    cell.b2.push_back(all.b2[i]);
    cell.depth_m.push_back(all.depth_m[i]);
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
                    const std::vector<const Cost*>& costs) const {
    NormalEquations equations;
    equations.reset(static_cast<Eigen::Index>(objective_.columns(picture).size()));
    objective_.add_costs(x_, picture, synthesis, costs, equations);
    return equations.gradient;
  }

  void add_cells(std::size_t picture, const PictureComparison& comparison,
                 const Synthesis& synthesis, MatrixXd& sum) const {
    const CellGrid grid(synthesis);
    const auto pixels = pixels_by_cell(synthesis, grid);
    const auto outline = outline_by_cell(comparison.outline, grid);
    ShadedPixels shaded;
    const double whole =
        comparison.colours != nullptr ? comparison.colours->shade(synthesis, shaded) : 0.0;
    MatrixXd scatter = MatrixXd::Zero(sum.rows(), sum.cols());
    int used = 0;
    for (std::size_t cell = 0; cell < pixels.size(); ++cell) {
      const Synthesis part{synthesis.space,  synthesis.x,  synthesis.scene,
                           synthesis.camera, pixels[cell], synthesis.projected};
      const ContourCost edge(outline[cell], &workspace_.target().topology);
      std::vector<const Cost*> costs;
      if (!outline[cell].empty()) costs.push_back(&edge);
      std::optional<PhotometricCost> colours;
      if (whole > 0.0 && pixels[cell].size() > 0) {
        // The cost is a mean; a cell's is to have the weight it has in the whole.
        PhotometricOptions options = comparison.options;
        options.reference_pixels *= comparison.colours->shade(part, shaded) / whole;
        colours.emplace(comparison.observation, &*workspace_.target().appearance,
                        &workspace_.target().topology, comparison.triangle_weight, options);
        if (options.reference_pixels > 0.0) costs.push_back(&*colours);
      }
      if (costs.empty()) continue;
      const VectorXd g = gradient(picture, part, costs);
      scatter += g * g.transpose();
      ++used;
    }
    // As many cells less than there are as the parameters can satisfy.
    const double left = std::max(1.0, used - 6.0);
    sum += used / left * scatter;
  }

  void add_offset(std::size_t picture, const PictureComparison& comparison,
                  const Synthesis& synthesis, MatrixXd& sum) const {
    if (comparison.outline.empty()) return;
    const SurfaceTopology* topology = &workspace_.target().topology;
    std::vector<ContourTarget> moved = comparison.outline;
    for (ContourTarget& target : moved) target.target_px += kOutlineOffset_px * target.normal;
    const ContourCost found(comparison.outline, topology), beside(std::move(moved), topology);
    const VectorXd g =
        gradient(picture, synthesis, {&beside}) - gradient(picture, synthesis, {&found});
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
