#include "semblance/geometry/contour.h"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

constexpr double pi = std::numbers::pi;

PeriodicContour circle(double radius) {
  return PeriodicContour(Eigen::VectorXd::Constant(8, radius));
}

// Three contours of no particular shape.
ContourStack wavy_stack() {
  Eigen::VectorXd a(8), b(8), c(8);
  a << 3, 4, 3, 5, 3, 4, 3, 5;
  b << 5, 5, 6, 5, 4, 5, 6, 5;
  c << 2, 3, 2, 2, 3, 2, 2, 3;
  return ContourStack({0.0, 1.0, 3.5},
                      {PeriodicContour(a), PeriodicContour(b), PeriodicContour(c)});
}

TEST(PeriodicContour, PassesThroughItsValuesAndIsSmooth) {
  Eigen::VectorXd angles(5), values(5);
  angles << 0.1, 1.0, 2.5, 3.3, 5.9;
  values << 1.0, 2.0, -1.0, 0.5, 0.7;
  const PeriodicContour contour(angles, values);
  const double h = 1e-6;
  for (int i = 0; i < 5; ++i) {
    EXPECT_NEAR(contour.at(angles[i]).value, values[i], 1e-12);
    EXPECT_NEAR(contour.at(angles[i] - 1e-9).slope, contour.at(angles[i] + 1e-9).slope, 1e-6);
    const double left = (contour.at(angles[i] - h).slope - contour.at(angles[i] - 2 * h).slope) / h;
    const double right =
        (contour.at(angles[i] + 2 * h).slope - contour.at(angles[i] + h).slope) / h;
    EXPECT_NEAR(left, right, 1e-3) << "second derivative at knot " << i;
  }
  for (double u = -7.0; u < 13.0; u += 0.31) {
    EXPECT_NEAR(contour.at(u).value, contour.at(u + 2.0 * pi).value, 1e-10);
    EXPECT_NEAR(contour.at(u).slope,
                (contour.at(u + h).value - contour.at(u - h).value) / (2.0 * h), 1e-6);
  }
}

TEST(PeriodicContour, ConvergesToASmoothCurve) {
  const auto f = [](double u) { return 2.0 + std::sin(u) + 0.3 * std::cos(3.0 * u); };
  double before = 1.0;
  for (const int n : {12, 24, 48}) {
    Eigen::VectorXd values(n);
    for (int i = 0; i < n; ++i) values[i] = f(2.0 * pi * i / n);
    const PeriodicContour contour(values);
    double worst = 0.0;
    for (double u = 0.0; u < 6.28; u += 0.01) {
      worst = std::max(worst, std::abs(contour.at(u).value - f(u)));
    }
    EXPECT_LT(worst, before / 8.0);  // fourth order would be 16
    before = worst;
  }
}

TEST(PeriodicContour, RejectsWhatIsNoContour) {
  EXPECT_THROW(PeriodicContour(Eigen::VectorXd::Ones(2)), InvalidInput);
  EXPECT_THROW(PeriodicContour(Eigen::Vector3d(0, 2, 1), Eigen::Vector3d::Ones()), InvalidInput);
  EXPECT_THROW(PeriodicContour(Eigen::Vector3d(0, 2, 7), Eigen::Vector3d::Ones()), InvalidInput);
}

TEST(ContourStack, SweepsACylinderAndACone) {
  const ContourStack cylinder({0.0, 1.0, 4.0}, {circle(2.0), circle(2.0), circle(2.0)});
  const ContourStack cone({0.0, 1.0, 4.0}, {circle(5.0), circle(4.0), circle(1.0)});
  for (double v = 0.0; v <= 2.0; v += 0.1) {
    for (double u = 0.0; u < 6.2; u += 0.7) {
      EXPECT_NEAR(cylinder.at(u, v).r, 2.0, 1e-12);
      const SweptPoint p = cone.at(u, v);
      EXPECT_NEAR(p.r, 5.0 - p.z, 1e-12);
      EXPECT_NEAR(p.dr_dv, -p.dz_dv, 1e-12);
      EXPECT_NEAR(p.dr_du, 0.0, 1e-12);
    }
  }
}

TEST(ContourStack, DerivativesAreDifferences) {
  ContourStack stack = wavy_stack();
  stack.set_bias(1, 0.7);
  stack.set_blend(0, 1.5);
  const double h = 1e-6;
  for (double v = 0.05; v < 1.97; v += 0.13) {
    for (double u = 0.02; u < 6.2; u += 0.41) {
      const SweptPoint p = stack.at(u, v), a = stack.at(u, v - h), b = stack.at(u, v + h);
      EXPECT_NEAR(p.dr_dv, (b.r - a.r) / (2 * h), 1e-6);
      EXPECT_NEAR(p.dz_dv, (b.z - a.z) / (2 * h), 1e-6);
      EXPECT_NEAR(p.dr_du, (stack.at(u + h, v).r - stack.at(u - h, v).r) / (2 * h), 1e-6);
    }
  }
}

TEST(ContourStack, JoinsWithOneTangentWhateverTheBias) {
  for (const double k : {0.25, 0.4, 1.0, 3.0}) {
    ContourStack stack = wavy_stack();
    stack.set_bias(1, k);
    stack.set_blend(1, 4.0);
    for (double u = 0.0; u < 6.2; u += 0.3) {
      const double e = 1e-13;
      const SweptPoint below = stack.at(u, 1.0 - e), above = stack.at(u, 1.0 + e);
      EXPECT_NEAR(below.r, above.r, 1e-10);
      EXPECT_NEAR(below.dr_dv, k * above.dr_dv, 1e-10);
      EXPECT_NEAR(below.dz_dv, k * above.dz_dv, 1e-10);
    }
  }
}

TEST(ContourStack, TrajectoryIsLinearWithoutBias) {
  const ContourStack stack = wavy_stack();
  EXPECT_NEAR(stack.at(0.3, 0.25).z, 0.25, 1e-13);
  EXPECT_NEAR(stack.at(0.3, 1.5).z, 2.25, 1e-13);
}

TEST(ContourStack, TakesGivenSlopes) {
  const PeriodicContour slope = circle(0.5);
  const ContourStack stack({0.0, 2.0}, {circle(1.0), circle(3.0)}, {slope, slope});
  const SweptPoint p = stack.at(1.0, 0.0);
  EXPECT_NEAR(p.dr_dv / p.dz_dv, 0.5, 1e-13);
}

TEST(ContourStack, RejectsBadStacks) {
  EXPECT_THROW(ContourStack({0.0}, {circle(1)}), InvalidInput);
  EXPECT_THROW(ContourStack({0.0, 0.0}, {circle(1), circle(1)}), InvalidInput);
  EXPECT_THROW(ContourStack({0.0, 1.0}, {circle(1), PeriodicContour(Eigen::VectorXd::Ones(5))}),
               InvalidInput);
  ContourStack stack = wavy_stack();
  EXPECT_THROW(stack.set_bias(0, 1.0), InvalidInput);
  EXPECT_THROW(stack.set_bias(1, 0.0), InvalidInput);
  EXPECT_THROW(stack.set_blend(2, 0.0), InvalidInput);
}

}  // namespace
}  // namespace semblance
