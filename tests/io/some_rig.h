// Cameras for tests of camera files, and how far two of them are from each other in the picture.
#pragma once

#include <algorithm>
#include <string>

#include "semblance/io/camera_rig.h"

namespace semblance::testing {

/// A camera with every figure its own, about 2 m before the world's origin.
inline Camera some_camera(const std::string& name, Lens lens, double turn_rad = 0.3) {
  Camera camera;
  camera.name = name;
  camera.width = 640;
  camera.height = 480;
  camera.focal_px = {1801.0 / 3.0, 1799.0 / 3.0};
  camera.principal_px = {318.7, 242.1 + 1.0 / 7.0};
  camera.lens = lens;
  const LensCoefficients values{-0.21, 0.03, 1e-3, -2e-3, 0.013, 0.02, -0.011, 0.004};
  std::copy_n(values.begin(), coefficient_count(lens), camera.distortion.begin());
  camera.camera_from_world = {
      quaternion_from_rotation_vector(Eigen::Vector3d(3.0, 0.2 + turn_rad, -turn_rad)),
      Eigen::Vector3d(0.1 * turn_rad, -0.05, 2.0 + turn_rad)};
  return camera;
}

/// Two cameras, named cam_0 and cam_1.
inline CameraRig some_rig(Lens lens) {
  return {{some_camera("cam_0", lens, 0.0), some_camera("cam_1", lens, 0.4)}};
}

/// The largest distance in pixels between the pictures of points around the world's origin.
inline double largest_difference_px(const Camera& a, const Camera& b) {
  double largest = 0.0;
  for (const double x : {-0.4, 0.05, 0.5}) {
    for (const double y : {-0.3, -0.1, 0.35}) {
      for (const double z : {-0.5, 0.0, 0.6}) {
        const Eigen::Vector3d point(x, y, z);
        largest = std::max(largest, (project_world(a, point) - project_world(b, point)).norm());
      }
    }
  }
  return largest;
}

}  // namespace semblance::testing
