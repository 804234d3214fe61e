// Points by the rays that see them.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "semblance/core/camera.h"

namespace semblance {

/// A pixel of a camera.
struct Ray {
  const Camera* camera = nullptr;
  Eigen::Vector2d pixel_px;
};

/// The point of the world that the rays come closest to, in least squares of distances. None for
/// rays that differ by less than an angle: two by less than `least_angle`, in radians.
std::optional<Eigen::Vector3d> point_from_rays(const std::vector<Ray>& rays,
                                               double least_angle = 0.1);

}  // namespace semblance
