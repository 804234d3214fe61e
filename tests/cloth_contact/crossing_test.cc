#include "crossing.h"

#include <gmock/gmock.h>

#include <Eigen/Geometry>

#include "semblance/core/random.h"

namespace semblance {
namespace {

using Eigen::Vector3d;
using Integer = __int128;

/// Exact for small whole numbers.
int whole_orientation(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
  Integer m[3][3];
  for (int k = 0; k < 3; ++k) {
    m[0][k] = Integer(a[k]) - Integer(d[k]);
    m[1][k] = Integer(b[k]) - Integer(d[k]);
    m[2][k] = Integer(c[k]) - Integer(d[k]);
  }
  const Integer det = m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
                      m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
                      m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
  return (det > 0) - (det < 0);
}

Vector3d whole_point(Random& random, int size) {
  return Vector3d(random.integer(2 * size + 1) - size, random.integer(2 * size + 1) - size,
                  random.integer(2 * size + 1) - size);
}

TEST(Orientation, IsThatOfWholeNumbers) {
  Random random(1);
  int flat = 0;
  for (int i = 0; i < 20000; ++i) {
    const int size = i % 2 ? 2 : 1 << 29;
    Vector3d a = whole_point(random, size), b = whole_point(random, size);
    Vector3d c = whole_point(random, size);
    // In the plane of the others, or one unit beside it.
    Vector3d d = i % 3 ? whole_point(random, size) : Vector3d(a + b - c);
    if (i % 6 == 3) d[random.integer(3)] += 1.0;
    const int sign = whole_orientation(a, b, c, d);
    flat += sign == 0;
    EXPECT_EQ(orientation(a, b, c, d), sign);
    EXPECT_EQ(orientation(b, a, c, d), -sign);
  }
  EXPECT_GT(flat, 100);
}

TEST(Orientation, SeesTheLastBit) {
  const Vector3d a(0.1, 0.2, 0.3), b(1.1, 0.7, 0.3), c(0.4, 1.3, 0.3);
  Vector3d d(0.61, 0.77, 0.3);
  EXPECT_EQ(orientation(a, b, c, d), 0);
  d.z() = std::nextafter(0.3, 1.0);
  EXPECT_NE(orientation(a, b, c, d), 0);
  const int above = orientation(a, b, c, d);
  d.z() = std::nextafter(0.3, 0.0);
  EXPECT_EQ(orientation(a, b, c, d), -above);
}

/// Whether a segment and a triangle share a point, by a linear programme in rational numbers: none
/// is at hand, so by all places where they could, of whole numbers, scaled to stay whole.
bool meets_by_cases(const Vector3d& p, const Vector3d& q, const Vector3d& a, const Vector3d& b,
                    const Vector3d& c) {
  const Vector3d n = (b - a).cross(c - a);
  const double hp = n.dot(p - a), hq = n.dot(q - a);  // exact: small whole numbers
  if (hp * hq > 0) return false;
  const auto inside = [&](const Vector3d& x, double scale) {  // point x / scale, n not zero
    const auto side = [&](const Vector3d& u, const Vector3d& v) {
      return (v - u).cross(x - scale * u).dot(n) * (scale > 0 ? 1 : -1);
    };
    return side(a, b) >= 0 && side(b, c) >= 0 && side(c, a) >= 0;
  };
  if (hp != hq) return inside(hp * q - hq * p, hp - hq);
  // In the plane: an end inside, or a crossing of sides, found along every side.
  if (inside(p, 1.0) || inside(q, 1.0)) return true;
  const Vector3d corners[4] = {a, b, c, a};
  for (int k = 0; k < 3; ++k) {
    const Vector3d u = corners[k], v = corners[k + 1];
    const double up = (q - p).cross(u - p).dot(n), vp = (q - p).cross(v - p).dot(n);
    const double pu = (v - u).cross(p - u).dot(n), qu = (v - u).cross(q - u).dot(n);
    if (up * vp <= 0 && pu * qu <= 0 && (up != 0 || vp != 0)) return true;
  }
  return false;
}

TEST(SegmentTriangle, AgreesWithWholeNumbers) {
  Random random(7);
  int met = 0, in_plane = 0, tried = 0;
  for (int i = 0; i < 60000; ++i) {
    const int size = i % 2 ? 2 : 5;
    const Vector3d a = whole_point(random, size), b = whole_point(random, size),
                   c = whole_point(random, size), p = whole_point(random, size),
                   q = whole_point(random, size);
    const Vector3d n = (b - a).cross(c - a);
    if (n.isZero() || p == q) continue;
    ++tried;
    in_plane += n.dot(p - a) == 0 && n.dot(q - a) == 0;
    const bool expected = meets_by_cases(p, q, a, b, c);
    met += expected;
    EXPECT_EQ(segment_meets_triangle(p, q, a, b, c), expected)
        << p.transpose() << " / " << q.transpose() << " / " << a.transpose() << " / "
        << b.transpose() << " / " << c.transpose();
  }
  EXPECT_GT(met, tried / 50);
  EXPECT_GT(in_plane, 100);
}

TEST(SegmentTriangle, CountsTouching) {
  const Vector3d a(0, 0, 0), b(1, 0, 0), c(0, 1, 0);
  EXPECT_TRUE(segment_meets_triangle({0.25, 0.25, 0}, {0.25, 0.25, 1}, a, b, c));  // end on face
  EXPECT_TRUE(segment_meets_triangle({0.5, 0, -1}, {0.5, 0, 1}, a, b, c));         // through side
  EXPECT_TRUE(segment_meets_triangle({-1, -1, 0}, {1, 1, 0}, a, b, c));            // in its plane
  EXPECT_TRUE(segment_meets_triangle({-1, 0, 0}, {2, 0, 0}, a, b, c));             // along a side
  EXPECT_TRUE(segment_meets_triangle({0.1, 0.1, 0}, {0.2, 0.2, 0}, a, b, c));      // within
  EXPECT_FALSE(segment_meets_triangle({1.5, 0, 0}, {2, 0, 0}, a, b, c));
  EXPECT_FALSE(segment_meets_triangle({0.5, -1e-300, -1}, {0.5, -1e-300, 1}, a, b, c));
  EXPECT_FALSE(segment_meets_triangle({0.25, 0.25, 1e-300}, {0.25, 0.25, 1}, a, b, c));
}

TEST(SegmentTriangle, TakesATriangleWithoutAreaForItsSides) {
  const Vector3d a(0, 0, 0), b(1, 0, 0), c(2, 0, 0);
  EXPECT_TRUE(segment_meets_triangle({1.5, -1, 0}, {1.5, 1, 0}, a, b, c));
  EXPECT_FALSE(segment_meets_triangle({1.5, -1, 0.1}, {1.5, 1, 0.1}, a, b, c));
  EXPECT_FALSE(segment_meets_triangle({2.5, -1, 0}, {2.5, 1, 0}, a, b, c));
  EXPECT_FALSE(segment_meets_triangle({0, 1, 0}, {1, 1, 0}, a, a, a));
  EXPECT_TRUE(segment_meets_triangle({-1, 0, 0}, {1, 0, 0}, a, a, a));
}

}  // namespace
}  // namespace semblance
