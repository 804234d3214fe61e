#include "projection_map.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

namespace semblance {

Eigen::Matrix<double, 2, Eigen::Dynamic> pixel_by_intrinsics(const Camera& camera,
                                                             const Eigen::Vector2d& direction) {
  const int coefficients = coefficient_count(camera.lens);
  const LensPoint lens = distort(camera.lens, camera.distortion, direction);
  Eigen::Matrix<double, 2, Eigen::Dynamic> result =
      Eigen::Matrix<double, 2, Eigen::Dynamic>::Zero(2, 4 + coefficients);
  result(0, 0) = lens.point.x();
  result(1, 1) = lens.point.y();
  result.block<2, 2>(0, 2).setIdentity();
  result.rightCols(coefficients) =
      camera.focal_px.asDiagonal() * lens.d_coefficients.leftCols(coefficients);
  return result;
}

Eigen::Matrix<double, 2, 3> pixel_by_rotation(const Camera& camera,
                                              const Eigen::Vector2d& direction) {
  const double x = direction.x(), y = direction.y();
  Eigen::Matrix<double, 2, 3> turned;  // of (x / z, y / z)
  turned << -x * y, 1.0 + x * x, -y, -1.0 - y * y, x * y, x;
  const LensPoint lens = distort(camera.lens, camera.distortion, direction);
  return camera.focal_px.asDiagonal() * lens.d_direction * turned;
}

ProjectionMap::ProjectionMap(const Camera& camera, int rows, int columns)
    : camera_(camera),
      rows_(rows),
      columns_(columns),
      motion_(static_cast<std::size_t>(rows * columns)) {
  const int parameters = 4 + coefficient_count(camera.lens);
  std::vector<Eigen::Matrix<double, 2, 3>> turn(motion_.size(),
                                                Eigen::Matrix<double, 2, 3>::Zero());
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(3, parameters);
  for (std::size_t cell = 0; cell < motion_.size(); ++cell) {
    const Eigen::Vector2d direction = unproject(camera, middle_of(cell)).head<2>();
    if (!direction.allFinite()) continue;
    motion_[cell] = pixel_by_intrinsics(camera, direction);
    turn[cell] = pixel_by_rotation(camera, direction);
    normal += turn[cell].transpose() * turn[cell];
    right += turn[cell].transpose() * motion_[cell];
  }
  const Eigen::MatrixXd undoing = normal.ldlt().solve(right);
  for (std::size_t cell = 0; cell < motion_.size(); ++cell) {
    if (motion_[cell].cols() > 0) motion_[cell] -= turn[cell] * undoing;
  }
}

Eigen::Vector2d ProjectionMap::middle_of(std::size_t cell) const {
  const auto index = static_cast<int>(cell);
  return {(index % columns_ + 0.5) * camera_.width / columns_,
          (index / columns_ + 0.5) * camera_.height / rows_};
}

Eigen::MatrixXd ProjectionMap::change_px(const Camera& other) const {
  std::vector<Eigen::Vector2d> change(motion_.size(), Eigen::Vector2d::Zero());
  std::vector<Eigen::Matrix<double, 2, 3>> turn(motion_.size(),
                                                Eigen::Matrix<double, 2, 3>::Zero());
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (std::size_t cell = 0; cell < motion_.size(); ++cell) {
    const Eigen::Vector3d direction = unproject(camera_, middle_of(cell));
    change[cell] = project(other, direction) - middle_of(cell);
    if (!direction.allFinite() || !change[cell].allFinite()) continue;
    turn[cell] = pixel_by_rotation(camera_, direction.head<2>());
    normal += turn[cell].transpose() * turn[cell];
    right += turn[cell].transpose() * change[cell];
  }
  const Eigen::Vector3d undoing = normal.ldlt().solve(right);
  Eigen::MatrixXd result(rows_, columns_);
  for (std::size_t cell = 0; cell < motion_.size(); ++cell) {
    const auto index = static_cast<Eigen::Index>(cell);
    result(index / columns_, index % columns_) = (change[cell] - turn[cell] * undoing).norm();
  }
  return result;
}

Eigen::MatrixXd ProjectionMap::sigma_px(const Eigen::MatrixXd& intrinsics_covariance) const {
  Eigen::MatrixXd result =
      Eigen::MatrixXd::Constant(rows_, columns_, std::numeric_limits<double>::quiet_NaN());
  for (std::size_t cell = 0; cell < motion_.size(); ++cell) {
    const auto& motion = motion_[cell];
    if (motion.cols() == 0) continue;
    const double trace = (motion * intrinsics_covariance * motion.transpose()).trace();
    const auto index = static_cast<Eigen::Index>(cell);
    result(index / columns_, index % columns_) = std::sqrt(0.5 * trace);
  }
  return result;
}

double ProjectionMap::mean_sigma_px(const Eigen::MatrixXd& intrinsics_covariance) const {
  double sum = 0.0;
  int count = 0;
  for (const auto& motion : motion_) {
    if (motion.cols() == 0) continue;
    sum += 0.5 * (motion * intrinsics_covariance * motion.transpose()).trace();
    ++count;
  }
  return std::sqrt(sum / std::max(count, 1));
}

}  // namespace semblance
