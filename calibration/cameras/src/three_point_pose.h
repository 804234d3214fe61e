// Pose from three points.
#pragma once

#include <Eigen/Core>
#include <array>

#include "semblance/core/rigid3.h"

namespace semblance {

/// At most four poses.
struct ThreePointPoses {
  std::array<Rigid3, 4> camera_from_object;
  int count = 0;
};

/// All poses that put three points on three rays of length 1 from the camera: Grunert's solution as
/// in Haralick et al., "Review and analysis of solutions of the three point perspective pose
/// estimation problem", IJCV 13, 1994, eq. 9. None for points in a line.
ThreePointPoses three_point_poses(const std::array<Eigen::Vector3d, 3>& points,
                                  const std::array<Eigen::Vector3d, 3>& rays);

}  // namespace semblance
