#include "semblance/cloth/distance.h"

#include <gmock/gmock.h>

#include <functional>

#include "semblance/core/random.h"

namespace semblance {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Wide = Eigen::Matrix<long double, 3, 1>;

using Function = std::function<long double(long double)>;

/// Least value on [0, 1] of a function with one minimum, by thirds.
long double least(const Function& f) {
  long double from = 0, to = 1;
  for (int i = 0; i < 90; ++i) {
    const long double u = from + (to - from) / 3, v = to - (to - from) / 3;
    (f(u) < f(v) ? to : from) = f(u) < f(v) ? v : u;
  }
  return std::min({f(0), f(1), f((from + to) / 2)});
}

/// Least distance of two pieces, each a function of parameters in [0, 1]: convex in one for any
/// value of the other, and its least value convex in the other.
long double triangle_distance(const Vector3d& p, const Vector3d& a, const Vector3d& b,
                              const Vector3d& c) {
  const Wide P = p.cast<long double>(), A = a.cast<long double>(), B = b.cast<long double>(),
             C = c.cast<long double>();
  return std::sqrt(least([&](long double u) {
    return least(
        [&](long double v) { return ((1 - u) * A + u * ((1 - v) * B + v * C) - P).squaredNorm(); });
  }));
}

long double segment_distance(const Vector3d& a0, const Vector3d& a1, const Vector3d& b0,
                             const Vector3d& b1) {
  const Wide A0 = a0.cast<long double>(), A1 = a1.cast<long double>(), B0 = b0.cast<long double>(),
             B1 = b1.cast<long double>();
  return std::sqrt(least([&](long double s) {
    return least(
        [&](long double t) { return (A0 + s * (A1 - A0) - B0 - t * (B1 - B0)).squaredNorm(); });
  }));
}

Vector3d random_point(Random& random) {
  return {random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)};
}

TEST(TriangleDistance, IsTheLeastOverAllPointsOfIt) {
  Random random(1);
  for (int i = 0; i < 300; ++i) {
    const Vector3d a = random_point(random), b = random_point(random), c = random_point(random);
    const Vector3d p = 1.5 * random_point(random);
    const TrianglePoint closest = closest_on_triangle(p, a, b, c);
    EXPECT_NEAR(closest.weight.sum(), 1.0, 1e-14);
    EXPECT_GE(closest.weight.minCoeff(), 0.0);
    EXPECT_LT((p - closest.weight[0] * a - closest.weight[1] * b - closest.weight[2] * c -
               closest.offset_m)
                  .norm(),
              1e-14);
    // No point of the triangle lies on this side of the plane through the closest one.
    for (const Vector3d& corner : {a, b, c})
      EXPECT_LE((corner - (p - closest.offset_m)).dot(closest.offset_m), 1e-12);
    if (i < 40) {
      EXPECT_NEAR(closest.offset_m.norm(), double(triangle_distance(p, a, b, c)), 1e-9);
    }
  }
}

TEST(TriangleDistance, HoldsForTrianglesWithoutArea) {
  const Vector3d a(0, 0, 0), b(1, 0, 0), p(0.3, 0.4, 0);
  EXPECT_NEAR(closest_on_triangle(p, a, b, Vector3d(0.5, 0, 0)).offset_m.norm(), 0.4, 1e-15);
  EXPECT_NEAR(closest_on_triangle(p, a, Vector3d(0.1, 0, 0), b).offset_m.norm(), 0.4, 1e-15);
  EXPECT_NEAR(closest_on_triangle(p, a, a, a).offset_m.norm(), 0.5, 1e-15);
  EXPECT_NEAR(closest_on_triangle(p, a, a, b).offset_m.norm(), 0.4, 1e-15);
  EXPECT_NEAR(closest_on_triangle(p, a, b, Vector3d(0.5, 1e-17, 0)).offset_m.norm(), 0.4, 1e-12);
}

TEST(TriangleDistance, IsExactNearThinTriangles) {
  Random random(4);
  for (int i = 0; i < 1000; ++i) {
    const Vector3d a = random_point(random), b = random_point(random);
    const Vector3d c = a + random.uniform() * (b - a) +
                       std::pow(10.0, random.uniform(-12, -1)) * random_point(random);
    const Vector3d p = random_point(random);
    const TrianglePoint closest = closest_on_triangle(p, a, b, c);
    for (const Vector3d& corner : {a, b, c})
      EXPECT_LE((corner - (p - closest.offset_m)).dot(closest.offset_m), 1e-7);
  }
}

TEST(SegmentDistance, IsTheLeastOverAllPointsOfBoth) {
  Random random(2);
  for (int i = 0; i < 60; ++i) {
    const Vector3d a0 = random_point(random), a1 = random_point(random);
    const Vector3d b0 = random_point(random), b1 = random_point(random);
    const SegmentPoints closest = closest_on_segments(a0, a1, b0, b1);
    EXPECT_NEAR(closest.offset_m.norm(), double(segment_distance(a0, a1, b0, b1)), 1e-9);
  }
}

TEST(SegmentDistance, SatisfiesTheConditionsOfAMinimum) {
  Random random(5);
  for (int i = 0; i < 3000; ++i) {
    const Vector3d a0 = random_point(random), u = random_point(random);
    // From arbitrary to all but parallel.
    const Vector3d v =
        (i % 2 ? 0.7 : -1.3) * u + std::pow(10.0, random.uniform(-14, 0)) * random_point(random);
    const Vector3d b0 = random_point(random), a1 = a0 + u, b1 = b0 + v;
    const SegmentPoints closest = closest_on_segments(a0, a1, b0, b1);
    const Vector3d r = closest.offset_m;
    EXPECT_LT((r - (a0 + closest.s * u - b0 - closest.t * v)).norm(), 1e-14);
    for (const Vector3d& a : {a0, a1}) EXPECT_GE((a - (a0 + closest.s * u)).dot(r), -1e-6);
    for (const Vector3d& b : {b0, b1}) EXPECT_LE((b - (b0 + closest.t * v)).dot(r), 1e-6);
  }
}

TEST(SegmentDistance, HoldsForParallelAndPointLikeSegments) {
  const Vector3d o(0, 0, 0), x(1, 0, 0), up(0, 0.5, 0);
  const SegmentPoints beside = closest_on_segments(o, x, o + up + 0.5 * x, up + 2.0 * x);
  EXPECT_NEAR(beside.offset_m.norm(), 0.5, 1e-15);
  EXPECT_NEAR(beside.s, 0.75, 1e-15);  // the middle of where they face each other
  EXPECT_NEAR(closest_on_segments(o, x, 2.0 * x, 3.0 * x).offset_m.norm(), 1.0, 1e-15);
  EXPECT_NEAR(closest_on_segments(o, x, 3.0 * x + up, 2.0 * x + up).offset_m.norm(),
              std::sqrt(1.25), 1e-15);
  EXPECT_NEAR(closest_on_segments(o, o, up, up).offset_m.norm(), 0.5, 1e-15);
  EXPECT_NEAR(closest_on_segments(up, up, o, x).offset_m.norm(), 0.5, 1e-15);
  EXPECT_NEAR(closest_on_segments(o, x, up, up).offset_m.norm(), 0.5, 1e-15);
}

}  // namespace
}  // namespace semblance
