#include "object_covariance.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace semblance {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kCells = 5;  // to each side of the object's box in the picture
// Of all of a picture alike, in pixels of the comparison.
constexpr double kColourOffset_px = 0.08;

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

std::vector<std::size_t> cells_of_targets(const OutlineComparison& outline, const CellGrid& grid) {
  std::vector<std::size_t> out;
  for (const ContourTarget& target : outline.targets()) {
    out.push_back(grid.cell_of(target.target_px.x(), target.target_px.y()));
  }
  return out;
}

class Scatter {
 public:
  Scatter(const ObjectObjective& objective, const VectorXd& x) : objective_(objective), x_(x) {}

  /// Adds a picture's share of the gradient's covariance to `out`.
  void add(std::size_t picture, const PictureComparison& comparison, MatrixXd& out) const {
    const std::vector<int> columns = objective_.columns(picture);
    const auto size = static_cast<Eigen::Index>(columns.size());
    MatrixXd sum = MatrixXd::Zero(size, size);
    objective_.with_synthesis(x_, picture, [&](const Synthesis& synthesis) {
      add_cells(picture, comparison, synthesis, sum);
    });
    out(columns, columns) += sum;
  }

 private:
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
    if (comparison.outline != nullptr && !comparison.outline->targets().empty()) {
      const MatrixXd found =
          comparison.outline->scores(objective_, x_, picture, synthesis,
                                     cells_of_targets(*comparison.outline, grid), kCells * kCells);
      scores += found.leftCols<kCells * kCells>();
      sum += found.rightCols<1>() * found.rightCols<1>().transpose();
    }
    // As many cells less than there are as the parameters can satisfy.
    const auto used = static_cast<double>((scores.colwise().squaredNorm().array() > 0.0).count());
    const double left = std::max(1.0, used - static_cast<double>(sum.rows()));
    sum += used / left * scores * scores.transpose();
  }

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

std::optional<MatrixXd> comparison_covariance(const ObjectObjective& objective, const VectorXd& x,
                                              const std::vector<PictureComparison>& comparisons) {
  NormalEquations all;
  if (!objective.normal_equations(x, all)) return std::nullopt;
  const auto inverse = inverse_of_normal(all.hessian);
  if (!inverse) return std::nullopt;
  MatrixXd scatter = objective.pairs_information(x);
  const Scatter cells(objective, x);
  for (std::size_t k = 0; k < comparisons.size(); ++k) cells.add(k, comparisons[k], scatter);
  return *inverse * scatter * *inverse;
}

}  // namespace semblance
