// Rotation and translation in space.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace semblance {

/// Rigid motion: point_b = rotation * point_a + translation_m for an object named b_from_a.
struct Rigid3 {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation_m = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& point) const {
    return rotation * point + translation_m;
  }
  /// c_from_a = c_from_b * b_from_a.
  Rigid3 operator*(const Rigid3& other) const {
    return {(rotation * other.rotation).normalized(),
            rotation * other.translation_m + translation_m};
  }
  Rigid3 inverse() const {
    const Eigen::Quaterniond back = rotation.conjugate();
    return {back, -(back * translation_m)};
  }
};

/// Rotation by |w| radians about w (exponential map).
Eigen::Quaterniond quaternion_from_rotation_vector(const Eigen::Vector3d& w);
/// The shortest rotation vector of q (logarithm), of length at most pi.
Eigen::Vector3d rotation_vector_from_quaternion(const Eigen::Quaterniond& q);

}  // namespace semblance
