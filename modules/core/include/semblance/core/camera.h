// A camera: size, lens and place.
#pragma once

#include <string>

#include "semblance/core/lens.h"
#include "semblance/core/rigid3.h"

namespace semblance {

/// A camera with one of the lenses of lens.h.
struct Camera {
  std::string name = "camera";
  int width = 0, height = 0;                           // pixels
  Eigen::Vector2d focal_px = Eigen::Vector2d::Ones();  // fx, fy
  Eigen::Vector2d principal_px = Eigen::Vector2d::Zero();
  Lens lens = Lens::pinhole;
  LensCoefficients distortion{};
  Rigid3 camera_from_world;

  /// A camera at the origin of the world with the principal point in the middle of the image. The
  /// world's y is up and its z points towards the camera's back, so the camera looks along -z.
  static Camera centred(int width, int height, double focal_px);

  /// The same view on an image `factor` times as large in each direction (for pyramids).
  Camera scaled(double factor) const;
  /// The same view without distortion.
  Camera without_distortion() const;
};

/// Pixel of a point given in the camera frame (z > 0; behind the camera the result is meaningless).
Eigen::Vector2d project(const Camera& camera, const Eigen::Vector3d& point_camera_m);
/// Pixel of a point given in the world frame.
Eigen::Vector2d project_world(const Camera& camera, const Eigen::Vector3d& point_world_m);
/// Direction with z = 1 in the camera frame that projects to the pixel; x and y are NaN where the
/// lens shows no direction (beyond the fold of a strong barrel distortion).
Eigen::Vector3d unproject(const Camera& camera, const Eigen::Vector2d& point_px);

/// Throws InvalidInput, naming `source`, unless every figure is finite and the size and focal
/// length are positive.
void validate(const Camera& camera, const std::string& source);

}  // namespace semblance
