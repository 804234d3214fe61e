#include "semblance/core/camera.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

void check(bool ok, const std::string& source, const Camera& camera, const std::string& problem) {
  if (!ok) throw InvalidInput(fmt::format("{}: camera '{}': {}", source, camera.name, problem));
}

}  // namespace

Camera Camera::centred(int width, int height, double focal_px) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.focal_px.setConstant(focal_px);
  camera.principal_px = {0.5 * width, 0.5 * height};
  camera.camera_from_world.rotation = Eigen::Quaterniond(0.0, 1.0, 0.0, 0.0);  // pi about x
  return camera;
}

Camera Camera::scaled(double factor) const {
  Camera result = *this;
  // Rounded up as downsample_half does; the slack keeps 100 * 0.7 from becoming 71.
  const auto size = [factor](int pixels) {
    return std::max(1, static_cast<int>(std::ceil(pixels * factor - 1e-6)));
  };
  result.width = size(width);
  result.height = size(height);
  result.focal_px *= factor;
  result.principal_px *= factor;
  return result;
}

Camera Camera::without_distortion() const {
  Camera result = *this;
  result.lens = Lens::pinhole;
  result.distortion.fill(0.0);
  return result;
}

Eigen::Vector2d project(const Camera& camera, const Eigen::Vector3d& point_camera_m) {
  Eigen::Vector2d point = point_camera_m.head<2>() / point_camera_m.z();
  if (camera.lens != Lens::pinhole) {
    point = distort(camera.lens, camera.distortion, point).point;
  }
  return camera.focal_px.cwiseProduct(point) + camera.principal_px;
}

Eigen::Vector2d project_world(const Camera& camera, const Eigen::Vector3d& point_world_m) {
  return project(camera, camera.camera_from_world * point_world_m);
}

Eigen::Vector3d unproject(const Camera& camera, const Eigen::Vector2d& point_px) {
  const Eigen::Vector2d point = (point_px - camera.principal_px).cwiseQuotient(camera.focal_px);
  return undistort(camera.lens, camera.distortion, point).homogeneous();
}

void validate(const Camera& camera, const std::string& source) {
  check(camera.width > 0 && camera.height > 0, source, camera,
        fmt::format("the image size is {} x {} pixels; both must be positive", camera.width,
                    camera.height));
  check(camera.focal_px.allFinite() && camera.focal_px.minCoeff() > 0.0, source, camera,
        fmt::format("the focal length is ({}, {}) pixels; both must be finite and positive",
                    camera.focal_px.x(), camera.focal_px.y()));
  check(camera.principal_px.allFinite(), source, camera,
        fmt::format("the principal point is ({}, {}); it must be finite", camera.principal_px.x(),
                    camera.principal_px.y()));
  for (int i = 0; i < coefficient_count(camera.lens); ++i) {
    const double coefficient = camera.distortion[static_cast<std::size_t>(i)];
    check(std::isfinite(coefficient), source, camera,
          fmt::format("distortion coefficient {} is {}; it must be finite",
                      coefficient_name(camera.lens, i), coefficient));
  }
  const Rigid3& pose = camera.camera_from_world;
  check(pose.rotation.coeffs().allFinite() && std::abs(pose.rotation.norm() - 1.0) < 1e-6, source,
        camera, "the rotation must be a finite quaternion of length 1 (w, x, y, z)");
  check(pose.translation_m.allFinite(), source, camera,
        "the translation must be three finite figures in metres");
}

}  // namespace semblance
