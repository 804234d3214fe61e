// The residual of one sighting, with derivatives, and the parameters it depends on.
#pragma once

#include <ceres/cost_function.h>
#include <ceres/manifold.h>

#include <array>
#include <vector>

#include "semblance/cameras/survey.h"

namespace semblance {

// A rigid motion as seven figures: Eigen's quaternion (x, y, z, w) and the translation. Steps are
// a rotation vector applied from the left and a shift.
using PoseBlock = std::array<double, 7>;
PoseBlock block_from_pose(const Rigid3& pose);
Rigid3 pose_from_block(const PoseBlock& block);

// Cost functions write derivatives by the step (six columns) into the first six columns of the
// seven that Ceres gives them, and leave the last at zero: the manifold's own derivative is
// then [I; 0]. It saves the detour over the quaternion's four figures.
class PoseManifold final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 7; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* delta, double* sum) const override;
  bool PlusJacobian(const double* x, double* jacobian) const override;
  bool Minus(const double* y, const double* x, double* difference) const override;
  bool MinusJacobian(const double* x, double* jacobian) const override;
};

// The parameter blocks of a Reprojection, in this order.
//   intrinsics  focal_px, aspect = fy / fx, cx, cy, coefficients of the lens
//   camera      PoseBlock, camera_from_world
//   placement   PoseBlock, world_from_target
//   point       metres, in the target's frame
//   warp        metres (Survey::warp_m)
//   offset      seconds
enum ReprojectionBlock {
  block_intrinsics,
  block_camera,
  block_placement,
  block_point,
  block_warp,
  block_offset,
  block_count
};

constexpr int kFixedIntrinsics = 4;  // those before the coefficients
std::vector<double> intrinsics_block(const Camera& camera);
void set_intrinsics(const std::vector<double>& block, Camera& camera);

// The factors of the warp's three figures at a point of the target.
Eigen::Vector3d warp_shape(const Eigen::Vector3d& point, const Eigen::AlignedBox3d& box);
Eigen::AlignedBox3d points_box(const Survey& survey);

// In pixels, over the sighting's spread.
class Reprojection final : public ceres::CostFunction {
 public:
  Reprojection(Lens lens, const Sighting& sighting, const Eigen::Vector3d& warp_shape);
  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  Lens lens_;
  Eigen::Vector2d pixel_px_, velocity_px_s_;
  double weight_;
  Eigen::Vector3d warp_shape_;
};

}  // namespace semblance
