#include "sheet_warp.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numeric>

namespace semblance {

using Eigen::Matrix3d;
using Eigen::Vector2d;

namespace {

constexpr std::size_t kNeighbours = 16;

/// Moves the mean to the origin and the mean distance to sqrt(2).
Matrix3d normaliser(const std::vector<Vector2d>& points) {
  Vector2d mean = Vector2d::Zero();
  for (const Vector2d& p : points) mean += p / static_cast<double>(points.size());
  double distance = 0.0;
  for (const Vector2d& p : points) {
    distance += (p - mean).norm() / static_cast<double>(points.size());
  }
  const double scale = std::sqrt(2.0) / std::max(distance, 1e-12);
  Matrix3d t = Matrix3d::Identity();
  t.diagonal() << scale, scale, 1.0;
  t.topRightCorner<2, 1>() = -scale * mean;
  return t;
}

}  // namespace

Matrix3d fit_homography(const std::vector<Vector2d>& a, const std::vector<Vector2d>& b) {
  const Matrix3d ta = normaliser(a), tb = normaliser(b);
  Eigen::Matrix<double, 9, 9> normal = Eigen::Matrix<double, 9, 9>::Zero();
  for (std::size_t i = 0; i < a.size(); ++i) {
    const Eigen::RowVector3d p = (ta * a[i].homogeneous()).transpose();
    const Vector2d q = (tb * b[i].homogeneous()).head<2>();
    Eigen::Matrix<double, 2, 9> rows = Eigen::Matrix<double, 2, 9>::Zero();
    rows.block<1, 3>(0, 0) = p;
    rows.block<1, 3>(0, 6) = -q.x() * p;
    rows.block<1, 3>(1, 3) = p;
    rows.block<1, 3>(1, 6) = -q.y() * p;
    normal += rows.transpose() * rows;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>> solver(normal);
  const Eigen::Matrix<double, 9, 1> h = solver.eigenvectors().col(0);
  const Matrix3d normalised = Eigen::Map<const Matrix3d>(h.data()).transpose();
  return tb.inverse() * normalised * ta;
}

void SheetWarp::add(const Vector2d& sheet, const Vector2d& image_px) {
  sheet_.push_back(sheet);
  image_px_.push_back(image_px);
}

Matrix3d SheetWarp::local_homography(const Vector2d& sheet) const {
  std::vector<int> order(sheet_.size());
  std::iota(order.begin(), order.end(), 0);
  const std::size_t count = std::min(kNeighbours, order.size());
  std::partial_sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(count), order.end(),
                    [&](int i, int j) {
                      return (sheet_[i] - sheet).squaredNorm() < (sheet_[j] - sheet).squaredNorm();
                    });
  std::vector<Vector2d> a, b;
  for (std::size_t i = 0; i < count; ++i) {
    a.push_back(sheet_[order[i]]);
    b.push_back(image_px_[order[i]]);
  }
  return fit_homography(a, b);
}

Vector2d SheetWarp::predict(const Vector2d& sheet) const {
  return (local_homography(sheet) * sheet.homogeneous()).hnormalized();
}

Eigen::Matrix2d SheetWarp::jacobian(const Vector2d& sheet) const {
  const Matrix3d h = local_homography(sheet);
  const Eigen::Vector3d p = h * sheet.homogeneous();
  return (h.topLeftCorner<2, 2>() - p.hnormalized() * h.block<1, 2>(2, 0)) / p.z();
}

}  // namespace semblance
