#include "three_point_pose.h"

#include <Eigen/Geometry>
#include <cmath>
#include <complex>

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

/// Real roots by Ferrari's formula, each sharpened by Newton's method.
std::vector<double> real_roots(const Quartic& q) {
  using Complex = std::complex<double>;
  const double b = q[3] / q[4], c = q[2] / q[4], d = q[1] / q[4], e = q[0] / q[4];
  if (!std::isfinite(b + c + d + e)) return {};
  // y^4 + p y^2 + r y + s with x = y - b / 4.
  const double p = c - 3.0 * b * b / 8.0, r = d - b * c / 2.0 + b * b * b / 8.0;
  const double s = e - b * d / 4.0 + b * b * c / 16.0 - 3.0 * b * b * b * b / 256.0;
  // A root of the resolvent z^3 + p z^2 + (p^2/4 - s) z - r^2/8 by Cardano's formula.
  const double u = p * p / 4.0 - s, v = -r * r / 8.0;
  const double m = u - p * p / 3.0, n = 2.0 * p * p * p / 27.0 - p * u / 3.0 + v;
  const Complex root = std::sqrt(Complex(n * n / 4.0 + m * m * m / 27.0));
  const Complex sum = std::abs(-n / 2.0 + root) > std::abs(-n / 2.0 - root) ? -n / 2.0 + root
                                                                            : -n / 2.0 - root;
  const Complex cube = std::pow(sum, 1.0 / 3.0);
  const Complex z = std::abs(cube) > 1e-14 ? cube - m / (3.0 * cube) - p / 3.0 : Complex(-p / 3.0);
  const Complex w = std::sqrt(2.0 * z);
  std::vector<double> roots;
  for (const double sign : {1.0, -1.0}) {
    const Complex half = std::abs(w) > 1e-14 ? sign * r / w : Complex(0.0);
    const Complex inner = std::sqrt(-(2.0 * p + 2.0 * z + 2.0 * half));
    for (const double other : {1.0, -1.0}) {
      const Complex y = 0.5 * (sign * w + other * inner);
      if (std::abs(y.imag()) > 1e-4 * (1.0 + std::abs(y.real()))) continue;
      double x = y.real() - b / 4.0;
      for (int i = 0; i < 3; ++i) {
        const double slope = slope_at(q, x);
        if (slope != 0.0) x -= value_at(q, x) / slope;
      }
      if (std::isfinite(x)) roots.push_back(x);
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

std::vector<Rigid3> three_point_poses(const std::array<Vector3d, 3>& points,
                                      const std::array<Vector3d, 3>& rays) {
  const double a2 = (points[1] - points[2]).squaredNorm();
  const double b2 = (points[0] - points[2]).squaredNorm();
  const double c2 = (points[0] - points[1]).squaredNorm();
  const Matrix3d object = triad(points[0], points[1], points[2]);
  if (!object.allFinite() || b2 == 0.0) return {};
  const double ca = rays[1].dot(rays[2]), cb = rays[0].dot(rays[2]), cg = rays[0].dot(rays[1]);
  const double k = (a2 - c2) / b2, l = (a2 + c2) / b2;
  const Quartic quartic{
      (1.0 + k) * (1.0 + k) - 4.0 * a2 / b2 * cg * cg,
      4.0 * (-k * (1.0 + k) * cb + 2.0 * a2 / b2 * cg * cg * cb - (1.0 - l) * ca * cg),
      2.0 * (k * k - 1.0 + 2.0 * k * k * cb * cb + 2.0 * (b2 - c2) / b2 * ca * ca -
             4.0 * l * ca * cb * cg + 2.0 * (b2 - a2) / b2 * cg * cg),
      4.0 * (k * (1.0 - k) * cb - (1.0 - l) * ca * cg + 2.0 * c2 / b2 * ca * ca * cb),
      (k - 1.0) * (k - 1.0) - 4.0 * c2 / b2 * ca * ca};
  std::vector<Rigid3> poses;
  for (const double v : real_roots(quartic)) {
    // Lengths of the rays: the second u and the third v times the first.
    const double u = ((k - 1.0) * v * v - 2.0 * k * cb * v + 1.0 + k) / (2.0 * (cg - v * ca));
    const double first = std::sqrt(b2 / (1.0 + v * v - 2.0 * v * cb));
    if (!(v > 0.0) || !(u > 0.0) || !std::isfinite(first * u)) continue;
    const Vector3d seen = first * rays[0];
    const Matrix3d camera = triad(seen, first * u * rays[1], first * v * rays[2]);
    if (!camera.allFinite()) continue;
    const Matrix3d rotation = camera * object.transpose();
    poses.push_back({Eigen::Quaterniond(rotation), seen - rotation * points[0]});
  }
  return poses;
}

}  // namespace semblance
