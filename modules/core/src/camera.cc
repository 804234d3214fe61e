#include "semblance/core/camera.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

struct Distorted {
  Eigen::Vector2d point;
  Eigen::Matrix2d jacobian;  // d point / d undistorted
};

// Brown 1966 in OpenCV's parametrisation, on the plane z = 1.
Distorted distort(const std::array<double, 5>& d, const Eigen::Vector2d& point) {
  const auto [k1, k2, p1, p2, k3] = d;
  const double x = point.x(), y = point.y();
  const double r2 = x * x + y * y;
  const double radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
  const double slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3));  // d radial / dx = slope x
  Distorted result;
  result.point << x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
      y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
  const double cross = slope * x * y + 2.0 * p1 * x + 2.0 * p2 * y;
  result.jacobian << radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x, cross, cross,
      radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x;
  return result;
}

// Damped Newton iteration from the distorted point. NaN where no undistorted point on the near
// side of the lens's fold (where the determinant changes sign) maps to it.
Eigen::Vector2d undistort(const std::array<double, 5>& distortion, const Eigen::Vector2d& target) {
  Eigen::Vector2d point = target;
  Distorted here = distort(distortion, point);
  while (here.jacobian.determinant() <= 0.0 && point.norm() > 1e-6) {
    point *= 0.5;  // beyond the fold: start nearer to the axis
    here = distort(distortion, point);
  }
  const double tolerance = 1e-14 * (1.0 + target.norm());
  for (int iteration = 0; iteration < 50; ++iteration) {
    const Eigen::Vector2d error = target - here.point;
    if (error.norm() <= tolerance) return point;
    Eigen::Vector2d step = here.jacobian.inverse() * error;
    Distorted next = distort(distortion, point + step);
    for (int halving = 0; halving < 40; ++halving) {
      const bool better = (target - next.point).norm() < error.norm();
      if (better && next.jacobian.determinant() > 0.0) break;
      step *= 0.5;
      next = distort(distortion, point + step);
    }
    // Rounding stops the descent before the tolerance does when the figures are large.
    if ((target - next.point).norm() >= error.norm()) {
      if (error.norm() <= 1e3 * tolerance) return point;
      break;
    }
    point += step;
    here = next;
  }
  return Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
}

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
  if (camera.lens == Camera::Lens::brown5) point = distort(camera.distortion, point).point;
  return camera.focal_px.cwiseProduct(point) + camera.principal_px;
}

Eigen::Vector2d project_world(const Camera& camera, const Eigen::Vector3d& point_world_m) {
  return project(camera, camera.camera_from_world * point_world_m);
}

Eigen::Vector3d unproject(const Camera& camera, const Eigen::Vector2d& point_px) {
  Eigen::Vector2d point = (point_px - camera.principal_px).cwiseQuotient(camera.focal_px);
  if (camera.lens == Camera::Lens::brown5) point = undistort(camera.distortion, point);
  return point.homogeneous();
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
  for (std::size_t i = 0; i < camera.distortion.size(); ++i) {
    check(std::isfinite(camera.distortion[i]), source, camera,
          fmt::format("distortion coefficient {} of k1, k2, p1, p2, k3 is {}; it must be finite",
                      i + 1, camera.distortion[i]));
  }
  const Rigid3& pose = camera.camera_from_world;
  check(pose.rotation.coeffs().allFinite() && std::abs(pose.rotation.norm() - 1.0) < 1e-6, source,
        camera, "the rotation must be a finite quaternion of length 1 (w, x, y, z)");
  check(pose.translation_m.allFinite(), source, camera,
        "the translation must be three finite figures in metres");
}

}  // namespace semblance
