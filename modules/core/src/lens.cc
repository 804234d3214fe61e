#include "semblance/core/lens.h"

#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <numbers>

namespace semblance {
namespace {

constexpr int columns = 8;
using Row8 = Eigen::Matrix<double, 1, columns>;

struct LensRow {
  std::string_view name;
  int count;
  std::array<std::string_view, columns> coefficients;
};

// In the order of the enumeration.
constexpr std::array<LensRow, 5> table{{
    {"pinhole", 0, {}},
    {"brown2", 2, {"k1", "k2"}},
    {"brown5", 5, {"k1", "k2", "p1", "p2", "k3"}},
    {"brown8", 8, {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"}},
    {"fisheye", 4, {"k1", "k2", "k3", "k4"}},
}};

const LensRow& row_of(Lens lens) { return table[static_cast<std::size_t>(lens)]; }

// Even polynomial 1 + a s + b s^2 + c s^3 in s = r^2 and its slope by s.
struct Even {
  double value, slope;
};
Even even_polynomial(double s, double a, double b, double c) {
  return {1.0 + s * (a + s * (b + s * c)), a + s * (2.0 * b + s * 3.0 * c)};
}

LensPoint distort_brown(const LensCoefficients& k, const Eigen::Vector2d& direction) {
  const auto [k1, k2, p1, p2, k3, k4, k5, k6] = k;
  const double x = direction.x(), y = direction.y(), s = direction.squaredNorm();
  const Even above = even_polynomial(s, k1, k2, k3), below = even_polynomial(s, k4, k5, k6);
  const double radial = above.value / below.value;
  const double slope = (above.slope - radial * below.slope) / below.value;
  LensPoint result;
  result.point << x * radial + 2.0 * p1 * x * y + p2 * (s + 2.0 * x * x),
      y * radial + p1 * (s + 2.0 * y * y) + 2.0 * p2 * x * y;
  const double cross = 2.0 * (slope * x * y + p1 * x + p2 * y);
  result.d_direction << radial + 2.0 * slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x, cross, cross,
      radial + 2.0 * slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x;
  const double up = 1.0 / below.value, down = -radial / below.value;
  Row8 d_radial;
  d_radial << s * up, s * s * up, 0.0, 0.0, s * s * s * up, s * down, s * s * down,
      s * s * s * down;
  result.d_coefficients = direction * d_radial;
  result.d_coefficients.middleCols<2>(2) << 2.0 * x * y, s + 2.0 * x * x, s + 2.0 * y * y,
      2.0 * x * y;
  return result;
}

// theta_d(theta) with its slope; s = theta^2.
struct FisheyeAngle {
  double value, slope;
};
FisheyeAngle fisheye_angle(const LensCoefficients& k, double theta) {
  const double s = theta * theta;
  return {theta * (1.0 + s * (k[0] + s * (k[1] + s * (k[2] + s * k[3])))),
          1.0 + s * (3.0 * k[0] + s * (5.0 * k[1] + s * (7.0 * k[2] + s * 9.0 * k[3])))};
}

LensPoint distort_fisheye(const LensCoefficients& k, const Eigen::Vector2d& direction) {
  const double r = direction.norm();
  LensPoint result;
  result.d_coefficients.setZero();
  if (r < 1e-9) {  // the limit on the axis
    result.point = direction;
    result.d_direction.setIdentity();
    return result;
  }
  const double theta = std::atan(r), s = theta * theta;
  const auto [angle, slope] = fisheye_angle(k, theta);
  const Eigen::Vector2d radial = direction / r;
  result.point = angle * radial;
  const Eigen::Matrix2d along = radial * radial.transpose();
  result.d_direction =
      slope / (1.0 + r * r) * along + angle / r * (Eigen::Matrix2d::Identity() - along);
  double power = theta;
  for (int i = 0; i < 4; ++i) result.d_coefficients.col(i) = (power *= s) * radial;
  return result;
}

bool all_zero(const LensCoefficients& coefficients) { return coefficients == LensCoefficients{}; }

constexpr double not_shown = std::numeric_limits<double>::quiet_NaN();

// Damped Newton iteration from the distorted point. NaN where no undistorted point on the near
// side of the lens's fold (where the determinant changes sign) maps to it.
Eigen::Vector2d undistort_brown(const LensCoefficients& coefficients,
                                const Eigen::Vector2d& target) {
  Eigen::Vector2d point = target;
  LensPoint here = distort_brown(coefficients, point);
  while (here.d_direction.determinant() <= 0.0 && point.norm() > 1e-6) {
    point *= 0.5;  // beyond the fold: start nearer to the axis
    here = distort_brown(coefficients, point);
  }
  const double tolerance = 1e-14 * (1.0 + target.norm());
  for (int iteration = 0; iteration < 50; ++iteration) {
    const Eigen::Vector2d error = target - here.point;
    if (error.norm() <= tolerance) return point;
    Eigen::Vector2d step = here.d_direction.inverse() * error;
    LensPoint next = distort_brown(coefficients, point + step);
    for (int halving = 0; halving < 40; ++halving) {
      const bool better = (target - next.point).norm() < error.norm();
      if (better && next.d_direction.determinant() > 0.0) break;
      step *= 0.5;
      next = distort_brown(coefficients, point + step);
    }
    // Rounding stops the descent before the tolerance does when the figures are large.
    if ((target - next.point).norm() >= error.norm()) {
      if (error.norm() <= 1e3 * tolerance) return point;
      break;
    }
    point += step;
    here = next;
  }
  return Eigen::Vector2d::Constant(not_shown);
}

// The angle is found on the rising branch from the axis, by Newton's method kept inside a bracket.
Eigen::Vector2d undistort_fisheye(const LensCoefficients& k, const Eigen::Vector2d& target) {
  const double wanted = target.norm();
  if (wanted < 1e-9) return target;
  constexpr double quarter_turn = 0.5 * std::numbers::pi;
  constexpr int steps = 64;  // a fold narrower than 1.4 degrees is not looked for
  double low = 0.0, high = 0.0;
  for (int i = 1; i <= steps; ++i) {
    high = quarter_turn * i / steps;
    if (fisheye_angle(k, low).slope <= 0.0) break;
    if (fisheye_angle(k, high).value >= wanted) break;
    low = high;
  }
  if (fisheye_angle(k, low).slope <= 0.0 || !(fisheye_angle(k, high).value >= wanted)) {
    return Eigen::Vector2d::Constant(not_shown);
  }
  double theta = 0.5 * (low + high);
  for (int iteration = 0; iteration < 60; ++iteration) {
    const auto [value, slope] = fisheye_angle(k, theta);
    (value < wanted ? low : high) = theta;
    const double newton = theta - (value - wanted) / slope;
    const double next = newton > low && newton < high ? newton : 0.5 * (low + high);
    if (std::abs(next - theta) <= 1e-16 * quarter_turn) break;
    theta = next;
  }
  return target * (std::tan(theta) / wanted);
}

}  // namespace

int coefficient_count(Lens lens) { return row_of(lens).count; }

std::string_view coefficient_name(Lens lens, int index) {
  return row_of(lens).coefficients[static_cast<std::size_t>(index)];
}

std::string_view lens_name(Lens lens) { return row_of(lens).name; }

std::optional<Lens> lens_from_name(std::string_view name) {
  for (const Lens lens : all_lenses) {
    if (lens_name(lens) == name) return lens;
  }
  return std::nullopt;
}

LensPoint distort(Lens lens, const LensCoefficients& coefficients,
                  const Eigen::Vector2d& direction) {
  if (lens == Lens::fisheye) return distort_fisheye(coefficients, direction);
  if (lens != Lens::pinhole) return distort_brown(coefficients, direction);
  LensPoint result{direction, Eigen::Matrix2d::Identity(), {}};
  result.d_coefficients.setZero();
  return result;
}

Eigen::Vector2d undistort(Lens lens, const LensCoefficients& coefficients,
                          const Eigen::Vector2d& point) {
  if (lens == Lens::fisheye) return undistort_fisheye(coefficients, point);
  if (lens == Lens::pinhole || all_zero(coefficients)) return point;
  return undistort_brown(coefficients, point);
}

}  // namespace semblance
