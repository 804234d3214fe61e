#include "rays.h"

#include <Eigen/Dense>

namespace semblance {

std::optional<Eigen::Vector3d> point_from_rays(const std::vector<Ray>& rays, double least_angle) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const Ray& ray : rays) {
    const Rigid3 world_from_camera = ray.camera->camera_from_world.inverse();
    const Eigen::Vector3d direction =
        (world_from_camera.rotation * unproject(*ray.camera, ray.pixel_px)).normalized();
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - direction * direction.transpose();
    normal += across;
    right += across * world_from_camera.translation_m;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(normal);
  // Of two rays it is 1 - cos of the angle between them.
  if (!(eigen.eigenvalues()[0] > 0.5 * least_angle * least_angle)) return std::nullopt;
  return normal.ldlt().solve(right);
}

}  // namespace semblance
