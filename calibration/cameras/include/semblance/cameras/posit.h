// Pose from points by scaled orthography.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "semblance/core/camera.h"

namespace semblance {

struct PositPose {
  Rigid3 camera_from_object;
  int iterations = 0;
  double rms_px = 0.0;
};

/// DeMenthon and Davis, "Model-based object pose in 25 lines of code", IJCV 1995: the picture is
/// taken for a scaled orthographic one, whose pose follows from linear equations; perspective is
/// then put right point by point, and so on until the pose stays.
///
/// Needs no start, and comes within its reach of the least-squares pose: a start for the
/// adjustment. It converges where the object is not much deeper than it is far.
///
/// points_m: object frame, 3 x n. pixels_px: 2 x n. None for less than four points, points in a
/// plane, pixels that the lens does not show, and where it does not converge to a pose with all
/// points in front of the camera.
std::optional<PositPose> posit(const Camera& camera, const Eigen::Matrix3Xd& points_m,
                               const Eigen::Matrix2Xd& pixels_px);

/// camera_from_object by `posit`, or by the plane's own method (sheet_start.h) for points whose
/// least spread is under a hundredth of the greatest. None where neither finds one.
std::optional<Rigid3> pose_from_points(const Camera& camera, const Eigen::Matrix3Xd& points_m,
                                       const Eigen::Matrix2Xd& pixels_px);

}  // namespace semblance
