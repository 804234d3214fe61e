// Pictures of an ellipsoid with round dots, with exact truth: rays through 8 x 8 places of each
// pixel, cut with the discs themselves; blur and noise in linear light.
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "semblance/cameras/dots.h"
#include "semblance/core/conventions.h"
#include "semblance/core/random.h"
#include "semblance/io/marker_points.h"

namespace semblance::testing {

/// Light levels are linear, 0 to 1.
struct DotPaint {
  double blur_px = 0.7, noise = 0.004;
  double dot = 0.05, object = 0.6, background = 0.12;
};

struct DottedObject {
  Eigen::Vector3d half_axes_m{0.075, 0.1, 0.085};
  std::vector<Disc> discs;  // in the object's frame, normals out of it

  static std::string name_of(int disc) { return std::string("p").append(std::to_string(disc)); }

  std::vector<MarkerPoint> points(bool with_faces) const {
    std::vector<MarkerPoint> result;
    for (std::size_t i = 0; i < discs.size(); ++i) {
      MarkerPoint point{.name = name_of(static_cast<int>(i)), .position_m = discs[i].centre_m};
      if (with_faces) {
        point.radius_m = discs[i].radius_m;
        point.normal = discs[i].normal;
      }
      result.push_back(std::move(point));
    }
    return result;
  }
};

/// Dots of 5 to 9 mm all around an ellipsoid of a head's size, none closer than `apart_m`.
inline DottedObject dotted_head(Random& random, int dots, double apart_m = 0.025) {
  DottedObject object;
  while (static_cast<int>(object.discs.size()) < dots) {
    const Eigen::Vector3d on_sphere =
        Eigen::Vector3d(random.normal(), random.normal(), random.normal()).normalized();
    const Eigen::Vector3d at = object.half_axes_m.cwiseProduct(on_sphere);
    const bool crowded = std::any_of(object.discs.begin(), object.discs.end(), [&](const Disc& d) {
      return (d.centre_m - at).norm() < apart_m;
    });
    if (crowded) continue;
    object.discs.push_back({at, on_sphere.cwiseQuotient(object.half_axes_m).normalized(),
                            random.uniform(0.0025, 0.0045)});
  }
  return object;
}

/// Whether a disc faces the camera with at least this cosine.
inline bool faces(const Disc& disc, const Rigid3& camera_from_object, double least_cosine) {
  const Eigen::Vector3d at = camera_from_object * disc.centre_m;
  return -(camera_from_object.rotation * disc.normal).dot(at.normalized()) > least_cosine;
}

inline Rgb8 paint_dots(const Camera& camera, const DottedObject& object,
                       const Rigid3& camera_from_object, const DotPaint& paint,
                       std::uint64_t seed) {
  const Rigid3 object_from_camera = camera_from_object.inverse();
  cv::Mat light(camera.height, camera.width, CV_32F);
  const Eigen::Vector3d eye = object_from_camera.translation_m.cwiseQuotient(object.half_axes_m);
  // The object's outline, one ray a pixel.
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const Eigen::Vector3d ray =
          (object_from_camera.rotation * unproject(camera, {x + 0.5, y + 0.5}))
              .cwiseQuotient(object.half_axes_m);
      const double b = ray.dot(eye), a = ray.squaredNorm();
      const bool hit = b * b - a * (eye.squaredNorm() - 1.0) > 0.0;
      light.at<float>(y, x) = static_cast<float>(hit ? paint.object : paint.background);
    }
  }
  constexpr int kSide = 8;
  for (const Disc& disc : object.discs) {
    if (!faces(disc, camera_from_object, 0.03)) continue;
    const Eigen::Vector3d centre = camera_from_object * disc.centre_m;
    const Eigen::Vector3d normal = camera_from_object.rotation * disc.normal;
    const Eigen::Vector2d at = project(camera, centre);
    const double reach = 1.3 * camera.focal_px.maxCoeff() * disc.radius_m / centre.z() + 2.0;
    for (int y = std::max(0, static_cast<int>(at.y() - reach));
         y < std::min<double>(camera.height, at.y() + reach); ++y) {
      for (int x = std::max(0, static_cast<int>(at.x() - reach));
           x < std::min<double>(camera.width, at.x() + reach); ++x) {
        int inside = 0;
        for (int k = 0; k < kSide * kSide; ++k) {
          const Eigen::Vector3d ray =
              unproject(camera, {x + (k % kSide + 0.5) / kSide, y + (k / kSide + 0.5) / kSide});
          const Eigen::Vector3d on_plane = ray * (normal.dot(centre) / normal.dot(ray));
          inside += (on_plane - centre).norm() < disc.radius_m;
        }
        float& value = light.at<float>(y, x);
        value += static_cast<float>((paint.dot - paint.object) * inside / (kSide * kSide));
      }
    }
  }
  cv::GaussianBlur(light, light, {}, paint.blur_px);
  Random random(seed, 77);
  Rgb8 image{camera.width, camera.height, {}};
  image.data.resize(static_cast<std::size_t>(3) * camera.width * camera.height);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const double value = light.at<float>(y, x) + paint.noise * random.normal();
      const auto level = static_cast<std::uint8_t>(
          std::lround(255.0f * srgb_from_linear(static_cast<float>(value))));
      const auto pixel = 3 * (static_cast<std::size_t>(y) * camera.width + x);
      std::fill_n(image.data.begin() + static_cast<std::ptrdiff_t>(pixel), 3, level);
    }
  }
  return image;
}

/// A camera whose object hangs before it, turned by a rotation vector against an upright view.
inline Rigid3 view_of(const Eigen::Vector3d& turn_rad, const Eigen::Vector3d& at_m) {
  const Eigen::Quaterniond upright(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX()));
  return {quaternion_from_rotation_vector(turn_rad) * upright, at_m};
}

/// The disc whose image is near a dot, or -1.
inline int disc_at(const DottedObject& object, const Camera& camera, const Rigid3& pose,
                   const Eigen::Vector2d& at_px, double reach_px = 1.5) {
  int best = -1;
  for (std::size_t i = 0; i < object.discs.size(); ++i) {
    if (!faces(object.discs[i], pose, 0.03)) continue;
    const double d = (project(camera, pose * object.discs[i].centre_m) - at_px).norm();
    if (d >= reach_px) continue;
    reach_px = d;
    best = static_cast<int>(i);
  }
  return best;
}

}  // namespace semblance::testing
