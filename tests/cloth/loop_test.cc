// Peirce's hanging heart loop: both ends of a strip are clamped back to back, upright, and it hangs
// between them.
#include <gmock/gmock.h>

#include <cmath>

#include "sheets.h"

namespace semblance {
namespace {

/// From the lowest point half of the loop turns by this until it enters the clamp from above.
constexpr double whole_turn = 1.5 * std::numbers::pi;

struct End {
  double turn, x, y;
};

/// Half a loop of length 1 and rigidity 1 from its lowest point, theta'' = H sin(theta) -
/// w s cos(theta): H is the pull between the halves and w s the weight below. Runge-Kutta's
/// fourth-order method, Simpson's rule for x and y.
End shoot(double curvature, double pull, double weight) {
  constexpr int steps = 2000;
  constexpr double h = 1.0 / steps;
  const auto bend = [&](double s, double theta) {
    return pull * std::sin(theta) - weight * s * std::cos(theta);
  };
  End end{};
  for (int i = 0; i < steps; ++i) {
    const double s = i * h, theta = end.turn;
    const double k1 = bend(s, theta), k2 = bend(s + 0.5 * h, theta + 0.5 * h * curvature);
    const double k3 = bend(s + 0.5 * h, theta + 0.5 * h * (curvature + 0.5 * h * k1));
    const double k4 = bend(s + h, theta + h * (curvature + 0.5 * h * k2));
    const double middle = theta + 0.5 * h * (curvature + 0.25 * h * k1);
    end.turn += h * curvature + h * h / 6.0 * (k1 + k2 + k3);
    end.x += h / 6.0 * (std::cos(theta) + 4.0 * std::cos(middle) + std::cos(end.turn));
    end.y += h / 6.0 * (std::sin(theta) + 4.0 * std::sin(middle) + std::sin(end.turn));
    curvature += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
  }
  return end;
}

/// Height of the clamp above the lowest point over half of the loop's length, for the weight
/// w l^3 / B of that half; by Newton's method, from no weight on.
double heart_height(double weight) {
  Eigen::Vector2d unknown(whole_turn, 0.0);  // curvature at the lowest point, pull
  End end{};
  constexpr int increments = 10;
  for (int k = 0; k <= increments; ++k) {
    for (int i = 0; i < 8; ++i) {
      constexpr double nudge = 1e-6;
      const double w = weight * k / increments;
      end = shoot(unknown[0], unknown[1], w);
      const End a = shoot(unknown[0] + nudge, unknown[1], w);
      const End b = shoot(unknown[0], unknown[1] + nudge, w);
      Eigen::Matrix2d slope;
      slope << a.turn - end.turn, b.turn - end.turn, a.x - end.x, b.x - end.x;
      unknown -= nudge * slope.inverse() * Eigen::Vector2d(end.turn - whole_turn, end.x);
    }
  }
  EXPECT_LT(std::abs(end.turn - whole_turn) + std::abs(end.x), 1e-9);
  return end.y;
}

constexpr double half_m = 0.1;

/// A rough heart to start from: theta = whole_turn s + c sin(pi s), closed by c.
Points rough_heart(const Eigen::VectorXd& along_m) {
  constexpr int steps = 1000;
  const auto trace = [&](double c) {
    Points way = Points::Zero(steps + 1, 3);
    for (int i = 0; i < steps; ++i) {
      const double s = (i + 0.5) / steps;
      const double theta = whole_turn * s + c * std::sin(std::numbers::pi * s);
      way.row(i + 1) =
          way.row(i) + half_m / steps * Eigen::RowVector3d(std::cos(theta), std::sin(theta), 0.0);
    }
    return way;
  };
  double low = -1.5, high = 0.0;
  for (int i = 0; i < 50; ++i) {
    const double c = 0.5 * (low + high);
    (trace(c)(steps, 0) > 0.0 ? low : high) = c;
  }
  Points way = trace(low);
  EXPECT_NEAR(way(steps, 0), 0.0, 1e-9);
  way.col(1).array() -= way(steps, 1);
  Points out = Points::Zero(along_m.size(), 3);
  for (Eigen::Index v = 0; v < along_m.size(); ++v) {
    const double from_lowest_m = std::abs(along_m[v]);
    out.row(v) =
        way.row(std::min<Eigen::Index>(steps, std::lround(from_lowest_m / half_m * steps)));
    out(v, 0) = std::copysign(out(v, 0), along_m[v]);
    // Within the clamp the strip goes on downwards.
    out(v, 1) -= std::max(0.0, from_lowest_m - half_m);
  }
  return out;
}

/// Height of the clamps' edge above the lowest point.
double simulate(double bending_n_m, double spacing_m) {
  ClothScene scene;
  const double all_m = 2.0 * (half_m + spacing_m);
  scene.sheet = make_rectangle(all_m, 0.02, spacing_m);
  scene.fabric = linear_fabric(5000.0, 60.0, bending_n_m);
  scene.self_contact = false;  // the halves meet in the clamp
  const Eigen::VectorXd along_m = scene.sheet.material_m.col(0).array() - 0.5 * all_m;
  scene.start_m = rough_heart(along_m);
  scene.start_m.col(2) = -scene.sheet.material_m.col(1);
  for (Eigen::Index v = 0; v < along_m.size(); ++v) {
    if (std::abs(along_m[v]) > half_m - 1e-9) scene.fixed.push_back(static_cast<int>(v));
  }
  const Points positions_m = rest_of(scene, 1e-5);
  return -positions_m.col(1).minCoeff();
}

/// Peirce: without weight the heart is 0.1337 of the strip's length high.
TEST(HeartLoop, WithoutWeightIsPeirces) { EXPECT_NEAR(0.5 * heart_height(0.0), 0.1337, 3e-4); }

/// Heights of 31 to 51 mm, found within 0.2 to 0.6 %; the error falls with the spacing's square.
TEST(HeartLoop, HangsAsDeepAsTheElastica) {
  for (const double bending : {4e-4, 5e-5}) {
    const double weight = 0.2 * 9.80665 * std::pow(half_m, 3) / bending;
    const double exact_m = half_m * heart_height(weight);
    const double coarse = std::abs(simulate(bending, 0.005) / exact_m - 1.0);
    const double fine = std::abs(simulate(bending, 0.0025) / exact_m - 1.0);
    RecordProperty("error of B " + std::to_string(bending), std::to_string(fine));
    EXPECT_LT(fine, 0.01) << bending;
    EXPECT_GT(coarse, 3.0 * fine) << bending;
  }
}

}  // namespace
}  // namespace semblance
