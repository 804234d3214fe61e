#include "semblance/core/rigid3.h"

#include <cmath>

namespace semblance {

Eigen::Quaterniond quaternion_from_rotation_vector(const Eigen::Vector3d& w) {
  const double angle_squared = w.squaredNorm();
  // Below this the next term of the series of sin(a/2)/a is under the rounding of 1/2.
  if (angle_squared < 1e-16) {
    const Eigen::Vector3d half = 0.5 * w;
    return Eigen::Quaterniond(1.0, half.x(), half.y(), half.z());
  }
  const double angle = std::sqrt(angle_squared);
  const Eigen::Vector3d vector = w * (std::sin(0.5 * angle) / angle);
  return Eigen::Quaterniond(std::cos(0.5 * angle), vector.x(), vector.y(), vector.z());
}

Eigen::Vector3d rotation_vector_from_quaternion(const Eigen::Quaterniond& q) {
  // q and -q are the same rotation; the one with w >= 0 has the shorter vector.
  const double sign = std::signbit(q.w()) ? -1.0 : 1.0;
  const Eigen::Vector3d vector = sign * q.vec();
  const double sine_squared = vector.squaredNorm();
  if (sine_squared < 1e-16) return vector * (2.0 / (sign * q.w()));
  const double sine = std::sqrt(sine_squared);
  // atan2 is accurate at both ends, where acos loses half the digits (0) and asin does (pi).
  return vector * (2.0 * std::atan2(sine, sign * q.w()) / sine);
}

}  // namespace semblance
