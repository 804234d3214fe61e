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
/// rays that differ by less than a few degrees.
std::optional<Eigen::Vector3d> point_from_rays(const std::vector<Ray>& rays);

}  // namespace semblance
