#include "semblance/cloth/curve.h"

#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

Curve sampled(const std::function<double(double)>& function, double start, double end, int count) {
  std::vector<double> x, values;
  for (int i = 0; i < count; ++i) {
    x.push_back(start + (end - start) * i / (count - 1));
    values.push_back(function(x.back()));
  }
  return {x, values};
}

/// A rising curve through places at random distances, some of them tiny.
Curve random_curve(unsigned seed, Curve::Beyond beyond = Curve::Beyond::linear) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> exponent(-4.0, 0.0);
  std::vector<double> x{0.1}, values{0.3};
  for (int i = 0; i < 30; ++i) {
    x.push_back(x.back() + std::pow(10.0, exponent(random)));
    values.push_back(values.back() + std::pow(10.0, exponent(random)));
  }
  return {x, values, beyond};
}

/// Simpson's rule with so many steps that its error is that of rounding.
double quadrature(const Curve& curve, double from, double to) {
  constexpr int steps = 20000;
  const double h = (to - from) / steps;
  double sum = 0.0;
  for (int i = 0; i < steps; ++i) {
    const double x = from + h * i;
    sum += (curve.value(x) + 4.0 * curve.value(x + 0.5 * h) + curve.value(x + h)) * h / 6.0;
  }
  return sum;
}

TEST(Curve, LineIsExact) {
  const Curve line = Curve::linear(3.0, 0.5);
  for (const double x : {-2.0, 0.0, 0.2, 0.5, 7.0}) {
    const CurvePoint point = line.evaluate(x);
    EXPECT_DOUBLE_EQ(point.value, 3.0 * x);
    EXPECT_DOUBLE_EQ(point.slope, 3.0);
    EXPECT_NEAR(point.integral, 1.5 * x * x, 1e-12);
  }
  EXPECT_EQ(Curve().value(4.0), 0.0);
}

TEST(Curve, GoesThroughItsPointsAndRisesBetweenThem) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const Curve curve = random_curve(seed);
    for (std::size_t i = 0; i < curve.x().size(); ++i) {
      EXPECT_NEAR(curve.value(curve.x()[i]), curve.values()[i], 1e-12);
    }
    double before = -1e9;
    for (double x = -1.0; x < curve.last() + 1.0; x += 1e-3) {
      const CurvePoint point = curve.evaluate(x);
      EXPECT_GE(point.value, before - 1e-12);
      EXPECT_GE(point.slope, -1e-12);
      before = point.value;
    }
  }
}

TEST(Curve, SlopeIsThatOfDifferences) {
  const Curve curve = random_curve(3);
  constexpr double h = 1e-6;
  std::mt19937 random(1);
  std::uniform_real_distribution<double> place(-1.0, curve.last() + 1.0);
  for (int i = 0; i < 1000; ++i) {
    const double x = place(random);
    const double difference = (curve.value(x + h) - curve.value(x - h)) / (2.0 * h);
    // Second derivatives jump at the points, by up to 1e3 here.
    EXPECT_NEAR(curve.evaluate(x).slope, difference, 1e-2 + 1e-3 * difference);
  }
}

TEST(Curve, IntegralIsThatOfQuadratureInEveryPiece) {
  for (const auto beyond : {Curve::Beyond::linear, Curve::Beyond::constant}) {
    const Curve curve = random_curve(5, beyond);
    EXPECT_EQ(curve.evaluate(0.0).integral, 0.0);
    double from = -0.5, sum = quadrature(curve, 0.0, -0.5);
    std::vector<double> places = curve.x();
    places.push_back(curve.last() + 2.0);
    for (const double to : places) {
      sum += quadrature(curve, from, to);
      from = to;
      EXPECT_NEAR(curve.evaluate(to).integral, sum, 1e-10 * (1.0 + std::abs(sum)));
    }
  }
}

TEST(Curve, ApproachesSmoothFunctionsAndTheirDerivatives) {
  const Curve curve = sampled([](double x) { return std::exp(2.0 * x) - 1.0; }, 0.0, 1.0, 101);
  for (double x = 0.0; x <= 1.0; x += 0.013) {
    const CurvePoint point = curve.evaluate(x);
    EXPECT_NEAR(point.value, std::exp(2.0 * x) - 1.0, 2e-5);
    EXPECT_NEAR(point.slope, 2.0 * std::exp(2.0 * x), 5e-3);
    EXPECT_NEAR(point.integral, 0.5 * (std::exp(2.0 * x) - 1.0) - x, 1e-5);
  }
}

TEST(Curve, GoesOnByTangentsOrConstant) {
  const Curve line = random_curve(2), flat = random_curve(2, Curve::Beyond::constant);
  const double end = line.last();
  const double slope = line.evaluate(end).slope;
  EXPECT_NEAR(line.value(end + 2.0), line.value(end) + 2.0 * slope, 1e-12);
  EXPECT_NEAR(line.evaluate(end + 2.0).slope, slope, 1e-12);
  EXPECT_EQ(flat.value(end + 2.0), flat.values().back());
  EXPECT_EQ(flat.evaluate(end + 2.0).slope, 0.0);
  EXPECT_EQ(flat.value(-3.0), flat.values().front());
}

TEST(Curve, WhatIsNotFiniteStaysSo) {
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(std::isfinite(random_curve(1).value(infinity)));
  EXPECT_FALSE(std::isfinite(random_curve(1).value(-infinity)));
  EXPECT_TRUE(std::isnan(random_curve(1).value(std::numeric_limits<double>::quiet_NaN())));
}

TEST(Curve, RefusesWhatIsNoCurve) {
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_THROW(Curve({0.0}, {0.0}), InvalidInput);
  EXPECT_THROW(Curve({0.0, 1.0}, {0.0}), InvalidInput);
  EXPECT_THROW(Curve({0.0, 0.0}, {0.0, 1.0}), InvalidInput);
  EXPECT_THROW(Curve({1.0, 0.5}, {0.0, 1.0}), InvalidInput);
  EXPECT_THROW(Curve({-0.1, 0.5}, {0.0, 1.0}), InvalidInput);
  EXPECT_THROW(Curve({0.0, 0.5}, {0.0, infinity}), InvalidInput);
}

}  // namespace
}  // namespace semblance
