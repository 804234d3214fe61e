#include "semblance/geometry/marker_path.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "semblance/core/errors.h"
#include "semblance/core/random.h"

namespace semblance {
namespace {

using Eigen::Vector2d;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

Vector2d random_vector(Random& random, double scale) {
  return {random.uniform(-scale, scale), random.uniform(-scale, scale)};
}

PathControls random_controls(Random& random) {
  return {random.uniform(-0.9, 6.0), random.uniform(0.1, 0.9), random.uniform(-2.0, 3.0),
          random.uniform(0.1, 0.9), random.uniform(-2.0, 3.0)};
}

struct Case {
  MarkerKey first, second;
  Vector2d reference;
  MarkerControls controls;
};

Case random_case(int seed) {
  Random random(seed);
  Case c;
  c.first = {random.uniform(-3.0, 3.0), random_vector(random, 40.0), random_vector(random, 90.0),
             random.uniform(-9.0, 9.0)};
  c.second = {c.first.time_s + random.uniform(0.02, 3.0), random_vector(random, 40.0),
              random_vector(random, 90.0), random.uniform(-9.0, 9.0)};
  c.reference = random_vector(random, 5.0) + Vector2d(100.0, 0.0);
  c.controls = {random_controls(random), random_controls(random), random.uniform(-0.9, 6.0)};
  return c;
}

MarkerPath path_of(const Case& c) { return MarkerPath(c.first, c.second, c.reference, c.controls); }

TEST(MarkerPath, MeetsBothKeyFramesAndTheirVelocities) {
  for (int seed = 0; seed < 200; ++seed) {
    const Case c = random_case(seed);
    const MarkerPath path = path_of(c);
    const double length = c.second.time_s - c.first.time_s, h = 1e-6 * length;
    for (const MarkerKey& key : {c.first, c.second}) {
      const PathPoint state = path.at(key.time_s);
      EXPECT_LT((state.position.head<2>() - key.position).norm(), 1e-10) << seed;
      EXPECT_NEAR(state.position.z(), key.depth, 1e-12);
      EXPECT_LT((state.velocity.head<2>() - key.velocity).norm(), 1e-8) << seed;
      // The velocity again from positions alone, by a one-sided difference of second order.
      const double inwards = key.time_s == c.first.time_s ? h : -h;
      const Vector2d p0 = state.position.head<2>(),
                     p1 = path.at(key.time_s + inwards).position.head<2>(),
                     p2 = path.at(key.time_s + 2.0 * inwards).position.head<2>();
      const Vector2d difference = (4.0 * p1 - 3.0 * p0 - p2) / (2.0 * inwards);
      EXPECT_LT((difference - key.velocity).norm(), 1e-5 * (1.0 + 400.0 / length)) << seed;
    }
  }
}

TEST(MarkerPath, VelocityIsTheDerivative) {
  for (int seed = 0; seed < 50; ++seed) {
    const Case c = random_case(seed);
    const MarkerPath path = path_of(c);
    const double length = c.second.time_s - c.first.time_s, h = 1e-6 * length;
    for (double v = 0.05; v < 1.0; v += 0.1) {
      const double t = c.first.time_s + v * length;
      const Eigen::Vector3d difference =
          (path.at(t + h).position - path.at(t - h).position) / (2.0 * h);
      EXPECT_LT((path.at(t).velocity - difference).norm(), 1e-5 * (1.0 + difference.norm()));
    }
  }
}

TEST(MarkerPath, ReproducesStraightMotion) {
  const Vector2d start(3.0, -2.0), velocity(40.0, 25.0);
  const double from = 1.7, duration = 0.4;
  const MarkerPath path({from, start, velocity, 0.0},
                        {from + duration, start + duration * velocity, velocity, 0.0}, {0.5, 1.0});
  for (double t = 0.0; t <= duration; t += 0.03) {
    EXPECT_LT((path.at(from + t).position.head<2>() - start - t * velocity).norm(), 1e-12);
    EXPECT_LT((path.at(from + t).velocity.head<2>() - velocity).norm(), 1e-10);
  }
}

TEST(MarkerPath, HoldsBeforeAndAfterItsKeys) {
  const Case c = random_case(3);
  const MarkerPath path = path_of(c);
  EXPECT_EQ(path.at(c.first.time_s - 1.0).position, path.at(c.first.time_s).position);
  EXPECT_EQ(path.at(c.second.time_s + 1.0).position, path.at(c.second.time_s).position);
}

TEST(MarkerPath, DoesNotDependOnTheReferenceWhileBothComponentsAreAlike) {
  Case c = random_case(5);
  c.controls.tangential = c.controls.radial;
  const MarkerPath path = path_of(c);
  c.reference += Vector2d(-31.0, 17.0);
  const MarkerPath other = path_of(c);
  for (double t = c.first.time_s; t < c.second.time_s; t += 0.01) {
    EXPECT_LT((path.at(t).position - other.at(t).position).norm(), 1e-9);
  }
}

// The program of appendix I in double precision, with its offset A = Trans_value as an argument.
namespace printed {

double blend(double n, double v) { return ((1 + n) * v * v) / ((2 + n) * v * v - 2 * v + 1); }

double scaling_x(double x, double tangent, double alpha, double beta) {
  const double a = ((beta / (alpha * (alpha - 1))) + tangent) / alpha, b = -tangent;
  return x * (x - 1) * (a * x + b);
}

double scaling_y(double v, double tangent, double gamma, double delta) {
  return scaling_x(1 - v, -tangent, 1 - gamma, delta);
}

double r(double t, double r_a, double r_b, double v_a, double v_b, const PathControls& c) {
  const double tangent_0 = v_a / r_a, tangent_1 = v_b / r_b;
  const double x = scaling_x(t, tangent_0, c.alpha, c.beta * tangent_0 / 4.);
  const double y = scaling_y(t, tangent_1, c.gamma, c.delta * tangent_1 / 4.);
  return (1. - blend(c.n, t)) * (1. + x) * r_a + blend(c.n, t) * (1. + y) * r_b;
}

double w(double t, double w_b, double v_a, double v_b, double offset, const PathControls& c) {
  return r(t, offset, w_b + offset, v_a, v_b, c) - offset;
}

/// Point k of `frequency` between A and B, as `hpy` computes it for key frames one second apart.
Vector2d hpy(const MarkerKey& a, const MarkerKey& b, int k, int frequency,
             const MarkerControls& controls, bool projected_radius, double offset = 7.0) {
  const double r_a = a.position.norm(), t = k / double(frequency);
  const Vector2d u_r = a.position / r_a, u_theta(-u_r.y(), u_r.x());
  const double r_b = projected_radius ? b.position.dot(u_r) : b.position.norm();
  return r(t, r_a, r_b, a.velocity.dot(u_r), b.velocity.dot(u_r), controls.radial) * u_r +
         w(t, b.position.dot(u_theta), a.velocity.dot(u_theta), b.velocity.dot(u_theta), offset,
           controls.tangential) *
             u_theta;
}

}  // namespace printed

/// Our controls for the printed ones: there delta = -1 is the parabola.
MarkerControls without_turned_sign(MarkerControls controls) {
  controls.radial.delta *= -1.0;
  controls.tangential.delta *= -1.0;
  return controls;
}

TEST(MarkerPath, IsTheAppendixWhereThatKeepsItsConditions) {
  for (int seed = 0; seed < 50; ++seed) {
    Case c = random_case(seed);
    c.first.time_s = 0.0, c.second.time_s = 1.0;
    const MarkerPath path(c.first, c.second, {0.0, 0.0}, without_turned_sign(c.controls));
    for (int k = 0; k < 20; ++k) {
      const Vector2d expected = printed::hpy(c.first, c.second, k, 20, c.controls, true);
      EXPECT_LT((path.at(k / 20.0).position.head<2>() - expected).norm(),
                1e-9 * (1.0 + expected.norm()));
    }
  }
}

TEST(MarkerPath, HasNotTheDefectsOfTheAppendix) {
  const MarkerKey a{0.0, {20.0, 5.0}, {10.0, 4.0}, 0.0}, b{1.0, {12.0, 30.0}, {-8.0, 6.0}, 0.0};
  const MarkerPath path(a, b, {0.0, 0.0});
  const int frequency = 10;
  // Its loop ends a step before B, and with |OB| it would not arrive there either.
  EXPECT_GT((printed::hpy(a, b, frequency - 1, frequency, {}, true) - b.position).norm(), 0.5);
  EXPECT_GT((printed::hpy(a, b, frequency, frequency, {}, false) - b.position).norm(), 5.0);
  EXPECT_LT((path.at(1.0).position.head<2>() - b.position).norm(), 1e-12);
  // A height of one is the parabola at both ends.
  const PathControls parabola;
  const double slope = 3.0, v = 0.3;
  EXPECT_GT(
      std::abs(printed::scaling_y(v, slope, parabola.gamma, slope / 4.0) + slope * v * (1.0 - v)),
      0.1);
  EXPECT_NEAR(printed::scaling_y(v, slope, parabola.gamma, -slope / 4.0), -slope * v * (1.0 - v),
              1e-12);
}

void expect_refused(const Case& c, const std::string& message) {
  EXPECT_THAT([&] { path_of(c); }, ThrowsMessage<InvalidInput>(HasSubstr(message)));
}

TEST(MarkerPath, RefusesWithAMessage) {
  const Case good = random_case(1);
  Case c = good;
  c.second.time_s = c.first.time_s;
  expect_refused(c, "not in order of time");
  c = good;
  c.reference = c.first.position;
  expect_refused(c, "lies on the reference point");
  c = good;
  c.controls.radial.n = -1.0;
  expect_refused(c, "blending parameter n = -1.000000 must be a number above -1");
  c = good;
  c.controls.tangential.n = std::numeric_limits<double>::infinity();
  expect_refused(c, "blending parameter m");
  c = good;
  c.controls.depth_blend = -3.0;
  expect_refused(c, "blending parameter p");
  c = good;
  c.controls.radial.alpha = 0.0;
  expect_refused(c, "radial alpha = 0.000000 must lie strictly between 0 and 1");
  c = good;
  c.controls.tangential.gamma = 1.0;
  expect_refused(c, "tangential gamma");
  c = good;
  c.controls.tangential.delta = std::nan("");
  expect_refused(c, "tangential delta must be finite");
  c = good;
  c.second.velocity.x() = std::nan("");
  expect_refused(c, "must be finite");
}

}  // namespace
}  // namespace semblance
