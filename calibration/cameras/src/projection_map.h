// How uncertain intrinsics move what a camera shows.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "semblance/core/camera.h"

namespace semblance {

/// Over cells of the picture: how the pixel of a direction moves with the intrinsics (fx, fy, cx,
/// cy, coefficients), less the rotation of the camera that undoes most of it over the picture. A
/// shift of the principal point, say, is to a calibration nearly the same as a turn of the camera,
/// and harms only as far as it is not. (The idea is that of the mrcal documentation, "Projection
/// uncertainty"; there the turn is found from the sheets' poses.)
class ProjectionMap {
 public:
  /// Cells that the lens does not show are left out: their deviation is NaN.
  ProjectionMap(const Camera& camera, int rows, int columns);

  /// Deviation in pixels, the root of half the trace of each cell's covariance. Row 0 is the
  /// picture's uppermost.
  Eigen::MatrixXd sigma_px(const Eigen::MatrixXd& intrinsics_covariance) const;
  /// Root of the mean of its squares.
  double mean_sigma_px(const Eigen::MatrixXd& intrinsics_covariance) const;
  /// How far another camera's projection of each cell's direction is away, less the small rotation
  /// that undoes most of it. NaN where either lens does not show it.
  Eigen::MatrixXd change_px(const Camera& other) const;

 private:
  Eigen::Vector2d middle_of(std::size_t cell) const;

  Camera camera_;
  int rows_, columns_;
  std::vector<Eigen::Matrix<double, 2, Eigen::Dynamic>> motion_;  // empty: not shown
};

/// The pixel of the direction (x, y, 1) by fx, fy, cx, cy and the lens's coefficients.
Eigen::Matrix<double, 2, Eigen::Dynamic> pixel_by_intrinsics(const Camera& camera,
                                                             const Eigen::Vector2d& direction);
/// The pixel of the direction by a small rotation of the direction (camera frame).
Eigen::Matrix<double, 2, 3> pixel_by_rotation(const Camera& camera,
                                              const Eigen::Vector2d& direction);

}  // namespace semblance
