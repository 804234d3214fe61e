#include "three_point_pose.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace semblance {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Coefficients of a polynomial of fourth degree, the highest last.
using Quartic = std::array<double, 5>;

double value_at(const Quartic& q, double x) {
  return (((q[4] * x + q[3]) * x + q[2]) * x + q[1]) * x + q[0];
}
double slope_at(const Quartic& q, double x) {
  return ((4.0 * q[4] * x + 3.0 * q[3]) * x + 2.0 * q[2]) * x + q[1];
}

/// The largest real root of z^3 + p z^2 + u z + v (Cardano; by the cosine where all are real).
double largest_root(double p, double u, double v) {
  const double m = u - p * p / 3.0, n = 2.0 * p * p * p / 27.0 - p * u / 3.0 + v;
  const double inner = n * n / 4.0 + m * m * m / 27.0;
  if (inner >= 0.0) {
    const double root = std::sqrt(inner);
    return std::cbrt(-n / 2.0 + root) + std::cbrt(-n / 2.0 - root) - p / 3.0;
  }
  const double size = 2.0 * std::sqrt(-m / 3.0);
  const double cosine = std::clamp(3.0 * n / (m * size), -1.0, 1.0);
  return size * std::cos(std::acos(cosine) / 3.0) - p / 3.0;
}

struct Roots {
  std::array<double, 4> values{};
  int count = 0;
};

/// Real roots by Ferrari's formula, each sharpened by Newton's method.
Roots real_roots(const Quartic& q) {
  const double b = q[3] / q[4], c = q[2] / q[4], d = q[1] / q[4], e = q[0] / q[4];
  Roots roots;
  if (!std::isfinite(b + c + d + e)) return roots;
  // y^4 + p y^2 + r y + s with x = y - b / 4, and its resolvent.
  const double p = c - 3.0 * b * b / 8.0, r = d - b * c / 2.0 + b * b * b / 8.0;
  const double s = e - b * d / 4.0 + b * b * c / 16.0 - 3.0 * b * b * b * b / 256.0;
  const double z = std::max(largest_root(p, p * p / 4.0 - s, -r * r / 8.0), 1e-30);
  const double w = std::sqrt(2.0 * z);
  for (const double sign : {1.0, -1.0}) {
    double square = -(2.0 * p + 2.0 * z + 2.0 * sign * r / w);
    // A double root may come out a little imaginary.
    if (square < -1e-6 * (std::abs(p) + z)) continue;
    square = std::sqrt(std::max(square, 0.0));
    for (const double other : {1.0, -1.0}) {
      double x = 0.5 * (sign * w + other * square) - b / 4.0;
      for (int i = 0; i < 3; ++i) {
        const double slope = slope_at(q, x);
        if (slope != 0.0) x -= value_at(q, x) / slope;
      }
      if (std::isfinite(x)) roots.values[static_cast<std::size_t>(roots.count++)] = x;
    }
  }
  return roots;
}

Matrix3d triad(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  Matrix3d axes;
  axes.col(0) = (b - a).normalized();
  axes.col(2) = (b - a).cross(c - a).normalized();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  return axes;
}

}  // namespace

ThreePointPoses three_point_poses(const std::array<Vector3d, 3>& points,
                                  const std::array<Vector3d, 3>& rays) {
  const double a2 = (points[1] - points[2]).squaredNorm();
  const double b2 = (points[0] - points[2]).squaredNorm();
  const double c2 = (points[0] - points[1]).squaredNorm();
  const Matrix3d object = triad(points[0], points[1], points[2]);
  ThreePointPoses poses;
  if (!object.allFinite() || b2 == 0.0) return poses;
  const double ca = rays[1].dot(rays[2]), cb = rays[0].dot(rays[2]), cg = rays[0].dot(rays[1]);
  const double k = (a2 - c2) / b2, l = (a2 + c2) / b2;
  const Quartic quartic{
      (1.0 + k) * (1.0 + k) - 4.0 * a2 / b2 * cg * cg,
      4.0 * (-k * (1.0 + k) * cb + 2.0 * a2 / b2 * cg * cg * cb - (1.0 - l) * ca * cg),
      2.0 * (k * k - 1.0 + 2.0 * k * k * cb * cb + 2.0 * (b2 - c2) / b2 * ca * ca -
             4.0 * l * ca * cb * cg + 2.0 * (b2 - a2) / b2 * cg * cg),
      4.0 * (k * (1.0 - k) * cb - (1.0 - l) * ca * cg + 2.0 * c2 / b2 * ca * ca * cb),
      (k - 1.0) * (k - 1.0) - 4.0 * c2 / b2 * ca * ca};
  const Roots roots = real_roots(quartic);
  for (int i = 0; i < roots.count; ++i) {
    const double v = roots.values[static_cast<std::size_t>(i)];
    // Lengths of the rays: the second u and the third v times the first.
    const double u = ((k - 1.0) * v * v - 2.0 * k * cb * v + 1.0 + k) / (2.0 * (cg - v * ca));
    const double first = std::sqrt(b2 / (1.0 + v * v - 2.0 * v * cb));
    if (!(v > 0.0) || !(u > 0.0) || !std::isfinite(first * u)) continue;
    const Vector3d seen = first * rays[0];
    const Matrix3d camera = triad(seen, first * u * rays[1], first * v * rays[2]);
    if (!camera.allFinite()) continue;
    const Matrix3d rotation = camera * object.transpose();
    poses.camera_from_object[static_cast<std::size_t>(poses.count++)] = {
        Eigen::Quaterniond(rotation), seen - rotation * points[0]};
  }
  return poses;
}

}  // namespace semblance
