#include "semblance/cloth/response.h"

#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <vector>

namespace semblance {
namespace {

void expect_derivatives(const std::function<LawPoint(double)>& law, double at, double h,
                        double tolerance) {
  const LawPoint here = law(at), plus = law(at + h), minus = law(at - h);
  const double force = (plus.energy - minus.energy) / (2.0 * h);
  const double stiffness = (plus.force - minus.force) / (2.0 * h);
  EXPECT_NEAR(here.force, force, tolerance * (std::abs(force) + 1e-6)) << at;
  EXPECT_NEAR(here.stiffness, stiffness, tolerance * (std::abs(stiffness) + 1e-6)) << at;
}

TEST(TensionResponse, DerivativesAreDifferencesUnderEveryLaw) {
  const Curve curve({0.0, 0.02, 0.05}, {0.0, 50.0, 400.0});
  for (const CompressionLaw law :
       {CompressionLaw::buckling, CompressionLaw::none, CompressionLaw::as_tension}) {
    for (const double strain : {-0.2, -0.01, -1e-3, -1e-4, 0.005, 0.03, 0.08}) {
      expect_derivatives([&](double e) { return tension_response(curve, law, 1.5, e); }, strain,
                         1e-7, 1e-4);
    }
  }
}

TEST(TensionResponse, BuckledClothCarriesLittleMoreThanItsLoad) {
  const Curve curve = Curve::linear(5000.0, 0.1);
  const double force = tension_response(curve, CompressionLaw::buckling, 1.5, -0.01).force;
  EXPECT_LT(force, -1.5);
  EXPECT_GT(force, -1.5 - 0.011 * 5000.0 * 0.01);
  EXPECT_DOUBLE_EQ(tension_response(curve, CompressionLaw::as_tension, 1.5, -0.01).force, -50.0);
  EXPECT_EQ(tension_response(curve, CompressionLaw::none, 1.5, -0.01).force, 0.0);
}

/// An arc of constant length L between ends c apart: the energy is B kappa^2 / 2 per length.
TEST(InterlacedResponse, IsTheEnergyOfAnArc) {
  const double bending = 1e-5, stretch = 3000.0, length = 0.02;
  const auto law = [&](double y) { return interlaced_response(bending, stretch, length, y); };
  // Between two chords the ramp's constant cancels.
  const auto arc = [&](double theta) {
    return std::pair{std::sin(theta) / theta, 0.5 * bending * std::pow(2.0 * theta / length, 2)};
  };
  const auto [y1, e1] = arc(0.7);
  const auto [y2, e2] = arc(1.9);
  EXPECT_NEAR(law(y2).energy - law(y1).energy, e2 - e1, 1e-9 * e2);
  for (const double y : {0.3, 0.7, 0.9, 0.99, 1.01}) expect_derivatives(law, y, 1e-7, 1e-4);
  // Shortly before it buckles a pinned arc carries 12 B / L^2 (a beam pi^2 B / L^2).
  EXPECT_NEAR(law(0.999).force, -12.0 * bending / (length * length), 1e-2 * 0.3);
}

TEST(InterlacedResponse, IsContinuousWhereTheRampEnds) {
  double before = interlaced_response(1e-5, 3000.0, 0.02, 1.0).force;
  for (double y = 1.0; y > 0.99; y -= 1e-6) {
    const double now = interlaced_response(1e-5, 3000.0, 0.02, y).force;
    EXPECT_NEAR(now, before, 4e-3) << y;
    before = now;
  }
}

TEST(Dissipation, DerivativesAreDifferences) {
  const Dissipation lossy{0.5, 0.005, 0.01, 20.0, 0.004};
  for (const double e : {-0.02, 0.008, 0.0149, 0.0152, 0.1}) {
    expect_derivatives([&](double x) { return lossy.evaluate(x); }, e, 1e-8, 1e-5);
  }
}

/// Cycled slowly, a slider dissipates four times threshold times travel beyond its reach.
TEST(Dissipation, LoopHasTheAreaOfASlider) {
  const double reach = 0.002, threshold = 2.0, end = 0.05;
  double anchor = 0.0, before = 0.0, work = 0.0;
  const auto move_to = [&](double e) {
    const Dissipation lossy{threshold, reach, anchor, 0.0, before};
    const double force = lossy.evaluate(e).force;
    work += force * (e - before);
    anchor = lossy.slipped_anchor(e);
    before = e;
  };
  const int steps = 20000;
  for (int i = 0; i <= steps; ++i) move_to(end * i / steps);
  work = 0.0;
  for (int i = steps; i >= -steps; --i) move_to(end * i / steps);
  for (int i = -steps; i <= steps; ++i) move_to(end * i / steps);
  EXPECT_NEAR(work, 4.0 * threshold * (end - reach), 1e-3 * work);
}

}  // namespace
}  // namespace semblance
