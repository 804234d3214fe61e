#include "next_view.h"

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <numbers>

#include "semblance/core/rigid3.h"

namespace semblance {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

struct Box {
  Eigen::Vector3d low, high;

  double side() const { return (high - low).head<2>().maxCoeff(); }
  bool flat() const { return high.z() - low.z() < 0.01 * side(); }
  Eigen::Vector3d middle() const { return 0.5 * (low + high); }
};

Box box_of(const std::vector<Eigen::Vector3d>& points) {
  Box box{points.front(), points.front()};
  for (const Eigen::Vector3d& point : points) {
    box.low = box.low.cwiseMin(point);
    box.high = box.high.cwiseMax(point);
  }
  return box;
}

// The sheet with its middle at a place of the picture, `share` of the picture's width wide, tilted.
std::optional<Rigid3> sheet_at(const Camera& camera, const Box& box, const Eigen::Vector2d& place,
                               double share, const Eigen::Vector2d& tilt_rad) {
  const Eigen::Vector3d direction =
      unproject(camera, place.cwiseProduct(Eigen::Vector2d(camera.width, camera.height)));
  if (!direction.allFinite()) return std::nullopt;
  const double depth_m = box.side() * camera.focal_px.x() / (share * camera.width);
  Rigid3 pose;
  pose.rotation = quaternion_from_rotation_vector(Eigen::Vector3d(tilt_rad.x(), tilt_rad.y(), 0.0));
  pose.translation_m = depth_m * direction - pose.rotation * box.middle();
  return pose;
}

// Information on the intrinsics from the sheet's points at a pose that is itself unknown; empty
// where a point is not in the picture.
Eigen::MatrixXd information(const Camera& camera, const std::vector<Eigen::Vector3d>& points,
                            const Rigid3& camera_from_sheet) {
  const int n = 4 + coefficient_count(camera.lens);
  Eigen::MatrixXd intrinsics = Eigen::MatrixXd::Zero(n, n), mixed = Eigen::MatrixXd::Zero(n, 6);
  Eigen::Matrix<double, 6, 6> pose = Eigen::Matrix<double, 6, 6>::Zero();
  for (const Eigen::Vector3d& point : points) {
    const Eigen::Vector3d seen = camera_from_sheet * point;
    if (!(seen.z() > 0.0)) return {};
    const Eigen::Vector2d direction = seen.head<2>() / seen.z();
    const Eigen::Vector2d pixel = project(camera, seen);
    if (!(pixel.array() >= 0.0).all() || pixel.x() > camera.width || pixel.y() > camera.height) {
      return {};
    }
    const auto by_intrinsics = pixel_by_intrinsics(camera, direction);
    const LensPoint lens = distort(camera.lens, camera.distortion, direction);
    Eigen::Matrix<double, 2, 3> by_shift;
    by_shift << 1.0, 0.0, -direction.x(), 0.0, 1.0, -direction.y();
    by_shift = camera.focal_px.asDiagonal() * lens.d_direction * by_shift / seen.z();
    Eigen::Matrix<double, 2, 6> by_pose;
    by_pose << pixel_by_rotation(camera, direction), by_shift;
    intrinsics += by_intrinsics.transpose() * by_intrinsics;
    mixed += by_intrinsics.transpose() * by_pose;
    pose += by_pose.transpose() * by_pose;
  }
  return intrinsics - mixed * pose.ldlt().solve(mixed.transpose());
}

Eigen::Matrix2Xd outline_of(const Camera& camera, const Box& box, const Rigid3& pose) {
  Eigen::Matrix2Xd outline(2, 4);
  const std::array<Eigen::Vector2d, 4> corners{{{0, 0}, {1, 0}, {1, 1}, {0, 1}}};
  for (Eigen::Index i = 0; i < 4; ++i) {
    Eigen::Vector3d corner = box.low;
    corner.head<2>() +=
        corners[static_cast<std::size_t>(i)].cwiseProduct((box.high - box.low).head<2>());
    outline.col(i) = project(camera, pose * corner);
  }
  return outline;
}

// The covariance after further information; parameters that were kept stay kept.
Eigen::MatrixXd updated(const Eigen::MatrixXd& covariance, const Eigen::MatrixXd& information) {
  const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(covariance.rows(), covariance.cols());
  // (C^-1 + I)^-1 = C (1 + I C)^-1, which a singular C does not break.
  return covariance * (identity + information * covariance).partialPivLu().inverse();
}

}  // namespace

std::optional<NextView> next_view(const Adjustment& adjustment, int camera,
                                  const ProjectionMap& map) {
  if (!adjustment.covariance || !(adjustment.sigma_px > 0.0)) return std::nullopt;
  const auto at = static_cast<std::size_t>(camera);
  const Eigen::MatrixXd& covariance = adjustment.covariance->cameras[at].intrinsics;
  if (covariance.isZero(0.0)) return std::nullopt;
  const Box box = box_of(adjustment.survey.points_m);
  if (!box.flat()) return std::nullopt;
  const Camera& seen_by = adjustment.survey.cameras[at];
  NextView best;
  best.mean_sigma_before_px = best.mean_sigma_after_px = map.mean_sigma_px(covariance);
  for (const double x : {0.2, 0.35, 0.5, 0.65, 0.8}) {
    for (const double y : {0.25, 0.5, 0.75}) {
      for (const double share : {0.35, 0.6}) {
        for (const double tilt_x : {-40.0, 0.0, 40.0}) {
          for (const double tilt_y : {-40.0, 0.0, 40.0}) {
            const auto pose =
                sheet_at(seen_by, box, {x, y}, share, kDegree * Eigen::Vector2d(tilt_x, tilt_y));
            if (!pose) continue;
            const Eigen::MatrixXd gained = information(seen_by, adjustment.survey.points_m, *pose);
            if (gained.size() == 0) continue;
            const double sigma_px = adjustment.sigma_px;
            const double after =
                map.mean_sigma_px(updated(covariance, gained / (sigma_px * sigma_px)));
            if (!(after < best.mean_sigma_after_px)) continue;
            best.mean_sigma_after_px = after;
            best.camera_from_sheet = *pose;
          }
        }
      }
    }
  }
  if (!(best.mean_sigma_after_px < best.mean_sigma_before_px)) return std::nullopt;
  best.outline_px = outline_of(seen_by, box, best.camera_from_sheet);
  return best;
}

}  // namespace semblance
