// A heavy strip clamped at one end against the elastica.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "sheets.h"

namespace semblance {
namespace {

struct Tip {
  double reach_m, drop_m;
};

/// The plane elastica under its own weight, B theta'' = -w t cos(theta) with t the length from the
/// free end and theta the slope below the horizontal: shot from the free end (theta' = 0) so that
/// theta = 0 at the clamp, by Runge-Kutta's fourth-order method.
Tip elastica(double bending_n_m, double weight_n_m2, double length_m) {
  constexpr int steps = 20000;
  const double h = length_m / steps;
  const auto bend = [&](double t, double theta) {
    return -weight_n_m2 * t * std::cos(theta) / bending_n_m;
  };
  Tip tip{};
  const auto slope_at_clamp = [&](double from_vertical) {
    double theta = 0.5 * std::numbers::pi - from_vertical, k = 0.0;
    tip = {};
    for (int i = 0; i < steps; ++i) {
      const double t = i * h;
      const double k1 = bend(t, theta), k2 = bend(t + 0.5 * h, theta + 0.5 * h * k);
      const double k3 = bend(t + 0.5 * h, theta + 0.5 * h * (k + 0.5 * h * k1));
      const double k4 = bend(t + h, theta + h * (k + 0.5 * h * k2));
      const double middle = theta + 0.5 * h * (k + 0.25 * h * k1);
      const double next = theta + h * k + h * h / 6.0 * (k1 + k2 + k3);
      tip.reach_m += h / 6.0 * (std::cos(theta) + 4.0 * std::cos(middle) + std::cos(next));
      tip.drop_m += h / 6.0 * (std::sin(theta) + 4.0 * std::sin(middle) + std::sin(next));
      theta = next;
      k += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
    }
    return theta;
  };
  double low = std::log(1e-12), high = std::log(0.5 * std::numbers::pi);
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (slope_at_clamp(std::exp(middle)) < 0.0 ? high : low) = middle;
  }
  return tip;
}

constexpr double length_m = 0.2;

/// The strip's tip at rest; the clamp's edge is at x = 0.
Tip simulate(double bending_n_m, double spacing_m, BendingModel bending, bool along_warp) {
  ClothScene scene;
  const double long_m = length_m + spacing_m;
  scene.sheet = along_warp ? make_rectangle(long_m, 0.04, spacing_m)
                           : make_rectangle(0.04, long_m, spacing_m);
  const int axis = along_warp ? 0 : 1;
  scene.fabric = linear_fabric(5000.0, 60.0, bending_n_m);
  scene.model.bending = bending;
  scene.self_contact = false;
  scene.start_m = Points::Zero(scene.sheet.vertex_count(), 3);
  scene.start_m.col(0) = scene.sheet.material_m.col(axis).array() - spacing_m;
  scene.start_m.col(2) = scene.sheet.material_m.col(1 - axis);
  for (Eigen::Index v = 0; v < scene.start_m.rows(); ++v) {
    if (scene.start_m(v, 0) < 1e-9) scene.fixed.push_back(static_cast<int>(v));
  }
  const Points positions_m = rest_of(scene, 1e-5);
  Tip tip{};
  int count = 0;
  for (Eigen::Index v = 0; v < positions_m.rows(); ++v) {
    if (scene.sheet.material_m(v, axis) < long_m - 1e-9) continue;
    tip.reach_m += positions_m(v, 0);
    tip.drop_m -= positions_m(v, 1);
    ++count;
  }
  return {tip.reach_m / count, tip.drop_m / count};
}

double error_of(const Tip& found, const Tip& exact) {
  return std::hypot(found.reach_m - exact.reach_m, found.drop_m - exact.drop_m) / length_m;
}

TEST(Cantilever, ElasticaOfASmallLoadIsTheBeam) {
  // w L^4 / (8 B) for small slopes.
  EXPECT_NEAR(elastica(1.0, 1.0, 0.2).drop_m, std::pow(0.2, 4) / 8.0, 1e-7);
}

TEST(Cantilever, ConvergesToTheElasticaWithTheSquareOfTheSpacing) {
  for (const double bending : {1e-3, 2e-4}) {
    const Tip exact = elastica(bending, 0.2 * 9.80665, length_m);
    double coarser = std::numeric_limits<double>::infinity();
    for (const double spacing_m : {0.02, 0.01, 0.005, 0.0025}) {
      const double error =
          error_of(simulate(bending, spacing_m, BendingModel::curvature, true), exact);
      RecordProperty(fmt::format("error of B {:g} at {:g} m", bending, spacing_m),
                     std::to_string(error));
      EXPECT_GT(coarser, 3.0 * error) << spacing_m;
      coarser = error;
    }
    EXPECT_LT(coarser, 0.002);
  }
}

TEST(Cantilever, WarpAndWeftBendAlike) {
  const Tip warp = simulate(5e-4, 0.01, BendingModel::curvature, true);
  const Tip weft = simulate(5e-4, 0.01, BendingModel::curvature, false);
  EXPECT_NEAR(warp.reach_m, weft.reach_m, 1e-5);
  EXPECT_NEAR(warp.drop_m, weft.drop_m, 1e-5);
}

double chord_deg(const Tip& tip) {
  return std::atan2(tip.drop_m, tip.reach_m) * 180.0 / std::numbers::pi;
}

/// ASTM D 1388: the strip is pushed over an edge until its tip lies 41.5 degrees below. Peirce
/// (1930): the bending length (B / w)^(1/3) is then L f, f^3 = cos(theta / 2) / (8 tan(theta)).
/// Against the elastica his formula is 1.9 % high here; the strip is within 0.04 degrees.
TEST(Cantilever, MeasuresPeircesBendingLength) {
  constexpr double angle_deg = 41.5, weight_n_m2 = 0.2 * 9.80665;
  double low = 1e-4, high = 1e-2;
  for (int i = 0; i < 18; ++i) {
    const double middle = std::sqrt(low * high);
    (chord_deg(elastica(middle, weight_n_m2, length_m)) > angle_deg ? low : high) = middle;
  }
  const Tip found = simulate(low, 0.005, BendingModel::curvature, true);
  const double theta = angle_deg * std::numbers::pi / 180.0;
  const double peirce_m = length_m * std::cbrt(std::cos(0.5 * theta) / (8.0 * std::tan(theta)));
  RecordProperty("angle_deg", std::to_string(chord_deg(found)));
  EXPECT_NEAR(chord_deg(found), angle_deg, 0.1);
  EXPECT_NEAR(std::cbrt(low / weight_n_m2), peirce_m, 0.02 * peirce_m);
}

/// Why they are not the default.
TEST(Cantilever, ChoiAndKosSpringsMoveAwayWhenTheMeshIsRefined) {
  const Tip exact = elastica(1e-3, 0.2 * 9.80665, length_m);
  const double coarse = error_of(simulate(1e-3, 0.02, BendingModel::interlaced, true), exact);
  const double fine = error_of(simulate(1e-3, 0.01, BendingModel::interlaced, true), exact);
  EXPECT_GT(coarse, 0.1);
  EXPECT_GT(fine, coarse);
}

}  // namespace
}  // namespace semblance
