#include "semblance/geometry/scaling.h"

#include <gmock/gmock.h>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

TEST(ScalingFunction, WithoutFeaturesIsTheReportsPolynomial) {
  const double p0 = 1.3, p1 = -0.4;
  const ScalingFunction s(p0, p1);
  for (double v = 0.0; v <= 1.0; v += 0.125) {
    EXPECT_NEAR(s.at(v).value, v * (v - 1.0) * ((p0 + p1) * v - p0), 1e-14);
  }
}

TEST(ScalingFunction, ThroughAHeightIsTheAppendixCubic) {
  const double slope = -0.7, alpha = 0.35, height = 0.2;
  const ScalingFunction s = ScalingFunction::through_height(slope, alpha, height);
  EXPECT_NEAR(s.at(alpha).value, height, 1e-14);
  for (double v = 0.0; v <= 1.0; v += 0.125) {
    EXPECT_NEAR(s.at(v).value, scaling_through(v, slope, alpha, height).value, 1e-14);
    EXPECT_NEAR(s.at(v).slope, scaling_through(v, slope, alpha, height).slope, 1e-14);
  }
}

TEST(ScalingFunction, PassesItsFeaturesAndIsSmoothThere) {
  const std::vector<Eigen::Vector2d> features = {{0.2, 0.3}, {0.5, -0.1}, {0.9, 0.4}};
  const ScalingFunction s(0.8, -2.0, features);
  EXPECT_EQ(s.at(0.0).value, 0.0);
  EXPECT_NEAR(s.at(1.0).value, 0.0, 1e-15);
  EXPECT_NEAR(s.at(0.0).slope, 0.8, 1e-13);
  EXPECT_NEAR(s.at(1.0).slope, -2.0, 1e-13);
  const double h = 1e-7;
  for (const Eigen::Vector2d& f : features) {
    EXPECT_NEAR(s.at(f.x()).value, f.y(), 1e-14);
    // Second derivatives from both sides: differences of the slope.
    const double before = (s.at(f.x()).slope - s.at(f.x() - h).slope) / h;
    const double after = (s.at(f.x() + h).slope - s.at(f.x()).slope) / h;
    EXPECT_NEAR(before, after, 1e-3);  // third derivatives are some 1,000
  }
}

TEST(ScalingFunction, ReproducesCubicsThroughTheirOwnPoints) {
  // Every clamped cubic spline through points of one cubic is that cubic.
  const auto cubic = [](double v) { return v * (v - 1.0) * (2.0 * v - 0.7); };
  const ScalingFunction s(0.7, 1.3, {{0.3, cubic(0.3)}, {0.45, cubic(0.45)}});
  for (double v = 0.0; v <= 1.0; v += 0.0625) EXPECT_NEAR(s.at(v).value, cubic(v), 1e-14);
}

TEST(ScalingFunction, DerivativesByControlsAreDifferences) {
  const ScalingFunction s(0.8, -2.0, {{0.25, 0.3}, {0.6, -0.1}});
  for (const double v : {0.1, 0.25, 0.5, 0.97}) {
    const auto d = s.derivatives(v);
    for (int k = 0; k < s.control_count(); ++k) {
      const Eigen::VectorXd step = Eigen::VectorXd::Unit(s.control_count(), k);
      const ValueSlope up = s.with_controls(s.controls() + step).at(v);
      const ValueSlope down = s.with_controls(s.controls() - step).at(v);
      EXPECT_NEAR(d.value[k], 0.5 * (up.value - down.value), 1e-13);
      EXPECT_NEAR(d.slope[k], 0.5 * (up.slope - down.slope), 1e-13);
    }
  }
}

TEST(ScalingFunction, RejectsFeaturesOutOfOrder) {
  EXPECT_THROW(ScalingFunction(0, 0, {{0.5, 1}, {0.5, 2}}), InvalidInput);
  EXPECT_THROW(ScalingFunction(0, 0, {{0.0, 1}}), InvalidInput);
  EXPECT_THROW(ScalingFunction(0, 0, {{1.0, 1}}), InvalidInput);
  EXPECT_THROW(ScalingFunction(NAN, 0), InvalidInput);
  std::vector<Eigen::Vector2d> features;
  while (features.size() < 64) features.emplace_back((1.0 + double(features.size())) / 66.0, 0.0);
  EXPECT_NO_THROW(ScalingFunction(0, 0, features));
  features.emplace_back(65.0 / 66.0, 0.0);
  EXPECT_THROW(ScalingFunction(0, 0, features), InvalidInput);
}

}  // namespace
}  // namespace semblance
