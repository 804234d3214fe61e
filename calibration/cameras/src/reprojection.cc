#include "reprojection.h"

#include <ceres/rotation.h>

#include <algorithm>

namespace semblance {
namespace {

using Eigen::Map;
using Eigen::Matrix;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using RowMajor27 = Matrix<double, 2, 7, Eigen::RowMajor>;
using RowMajor23 = Matrix<double, 2, 3, Eigen::RowMajor>;

Matrix3d cross_matrix(const Vector3d& v) {
  Matrix3d m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

// Derivatives of the pixel by a pose: d_point by the moved point, `turned` = R x.
void write_pose_jacobian(const RowMajor23& d_point, const Vector3d& turned, double* out) {
  Map<RowMajor27> jacobian(out);
  jacobian.leftCols<3>() = -d_point * cross_matrix(turned);
  jacobian.middleCols<3>(3) = d_point;
  jacobian.col(6).setZero();
}

}  // namespace

PoseBlock block_from_pose(const Rigid3& pose) {
  const Eigen::Quaterniond& q = pose.rotation;
  const Vector3d& t = pose.translation_m;
  return {q.x(), q.y(), q.z(), q.w(), t.x(), t.y(), t.z()};
}

Rigid3 pose_from_block(const PoseBlock& block) {
  return {Map<const Eigen::Quaterniond>(block.data()).normalized(),
          Map<const Vector3d>(block.data() + 4)};
}

bool PoseManifold::Plus(const double* x, const double* delta, double* sum) const {
  Map<Eigen::Quaterniond> turned(sum);
  turned = (quaternion_from_rotation_vector(Map<const Vector3d>(delta)) *
            Map<const Eigen::Quaterniond>(x))
               .normalized();
  Map<Vector3d>(sum + 4) = Map<const Vector3d>(x + 4) + Map<const Vector3d>(delta + 3);
  return true;
}

bool PoseManifold::PlusJacobian(const double*, double* jacobian) const {
  Map<Matrix<double, 7, 6, Eigen::RowMajor>>(jacobian).setIdentity();
  return true;
}

bool PoseManifold::Minus(const double* y, const double* x, double* difference) const {
  Map<Vector3d> turn(difference);
  turn = rotation_vector_from_quaternion(Map<const Eigen::Quaterniond>(y) *
                                         Map<const Eigen::Quaterniond>(x).conjugate());
  Map<Vector3d>(difference + 3) = Map<const Vector3d>(y + 4) - Map<const Vector3d>(x + 4);
  return true;
}

bool PoseManifold::MinusJacobian(const double*, double* jacobian) const {
  Map<Matrix<double, 6, 7, Eigen::RowMajor>>(jacobian).setIdentity();
  return true;
}

std::vector<double> intrinsics_block(const Camera& camera) {
  std::vector<double> block{camera.focal_px.x(), camera.focal_px.y() / camera.focal_px.x(),
                            camera.principal_px.x(), camera.principal_px.y()};
  block.insert(block.end(), camera.distortion.begin(),
               camera.distortion.begin() + coefficient_count(camera.lens));
  return block;
}

void set_intrinsics(const std::vector<double>& block, Camera& camera) {
  camera.focal_px = {block[0], block[0] * block[1]};
  camera.principal_px = {block[2], block[3]};
  std::copy(block.begin() + kFixedIntrinsics, block.end(), camera.distortion.begin());
}

Vector3d warp_shape(const Vector3d& point, const Eigen::AlignedBox3d& box) {
  const auto scaled = [&](int axis) {
    const double half = 0.5 * box.sizes()[axis];
    return half > 0.0 ? (point[axis] - box.center()[axis]) / half : 0.0;
  };
  const double u = scaled(0), v = scaled(1);
  return {1.0 - u * u, 1.0 - v * v, u * v};
}

Eigen::AlignedBox3d points_box(const Survey& survey) {
  Eigen::AlignedBox3d box;
  for (const Vector3d& point : survey.points_m) box.extend(point);
  return box;
}

Reprojection::Reprojection(Lens lens, const Sighting& sighting, const Vector3d& warp_shape)
    : lens_(lens),
      pixel_px_(sighting.pixel_px),
      velocity_px_s_(sighting.velocity_px_s),
      weight_(1.0 / sighting.spread),
      warp_shape_(warp_shape) {
  set_num_residuals(2);
  *mutable_parameter_block_sizes() = {kFixedIntrinsics + coefficient_count(lens), 7, 7, 3, 3, 1};
}

bool Reprojection::Evaluate(double const* const* parameters, double* residuals,
                            double** jacobians) const {
  const double* intrinsics = parameters[block_intrinsics];
  const Map<const Eigen::Quaterniond> camera(parameters[block_camera]);
  const Map<const Eigen::Quaterniond> placement(parameters[block_placement]);
  Vector3d on_target = Map<const Vector3d>(parameters[block_point]);
  on_target.z() += warp_shape_.dot(Map<const Vector3d>(parameters[block_warp]));
  const Vector3d turned_target = placement * on_target;
  const Vector3d turned_world =
      camera * (turned_target + Map<const Vector3d>(parameters[block_placement] + 4));
  const Vector3d seen = turned_world + Map<const Vector3d>(parameters[block_camera] + 4);
  if (!(seen.z() > 0.0)) return false;  // behind the camera: Ceres takes a shorter step

  const int count = coefficient_count(lens_);
  LensCoefficients coefficients{};
  std::copy_n(intrinsics + kFixedIntrinsics, count, coefficients.begin());
  const Vector2d direction = seen.head<2>() / seen.z();
  const LensPoint lens = distort(lens_, coefficients, direction);
  const Vector2d focal(intrinsics[0], intrinsics[0] * intrinsics[1]);
  // A clock that is off shows the point where it was at another time.
  Map<Vector2d> residual(residuals);
  residual = weight_ * (focal.cwiseProduct(lens.point) + Vector2d(intrinsics[2], intrinsics[3]) -
                        pixel_px_ + parameters[block_offset][0] * velocity_px_s_);
  if (!residual.allFinite() || !(focal.minCoeff() > 0.0)) return false;
  if (jacobians == nullptr) return true;

  if (jacobians[block_intrinsics] != nullptr) {
    Map<Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor>> jacobian(jacobians[block_intrinsics], 2,
                                                                     kFixedIntrinsics + count);
    jacobian.col(0) << lens.point.x(), intrinsics[1] * lens.point.y();
    jacobian.col(1) << 0.0, intrinsics[0] * lens.point.y();
    jacobian.middleCols<2>(2).setIdentity();
    jacobian.rightCols(count) = focal.asDiagonal() * lens.d_coefficients.leftCols(count);
    jacobian *= weight_;
  }
  RowMajor23 d_direction;
  d_direction << 1.0, 0.0, -direction.x(), 0.0, 1.0, -direction.y();
  const RowMajor23 d_seen =
      weight_ / seen.z() * focal.asDiagonal() * lens.d_direction * d_direction;
  if (jacobians[block_camera] != nullptr) {
    write_pose_jacobian(d_seen, turned_world, jacobians[block_camera]);
  }
  const RowMajor23 d_world = d_seen * camera.toRotationMatrix();
  if (jacobians[block_placement] != nullptr) {
    write_pose_jacobian(d_world, turned_target, jacobians[block_placement]);
  }
  const RowMajor23 d_target = d_world * placement.toRotationMatrix();
  if (jacobians[block_point] != nullptr) Map<RowMajor23>{jacobians[block_point]} = d_target;
  if (jacobians[block_warp] != nullptr) {
    Map<RowMajor23>{jacobians[block_warp]} = d_target.col(2) * warp_shape_.transpose();
  }
  if (jacobians[block_offset] != nullptr) {
    Map<Vector2d>{jacobians[block_offset]} = weight_ * velocity_px_s_;
  }
  return true;
}

}  // namespace semblance
