#include "semblance/cloth/distance.h"

#include <Eigen/Geometry>
#include <algorithm>

namespace semblance {
namespace {

using Eigen::Vector3d;

TrianglePoint point_of(const Vector3d& p, const Vector3d& a, const Vector3d& b, const Vector3d& c,
                       const Vector3d& weight) {
  return {weight, p - (weight[0] * a + weight[1] * b + weight[2] * c)};
}

TrianglePoint closest_on_longest_side(const Vector3d& p, const Vector3d& a, const Vector3d& b,
                                      const Vector3d& c) {
  const double ab = (b - a).squaredNorm(), bc = (c - b).squaredNorm(), ca = (a - c).squaredNorm();
  if (ab >= bc && ab >= ca) {
    const double t = closest_on_segment(p, a, b);
    return point_of(p, a, b, c, {1.0 - t, t, 0.0});
  }
  if (bc >= ca) {
    const double t = closest_on_segment(p, b, c);
    return point_of(p, a, b, c, {0.0, 1.0 - t, t});
  }
  const double t = closest_on_segment(p, c, a);
  return point_of(p, a, b, c, {t, 0.0, 1.0 - t});
}

/// Middle of the pairs of equal distance of parallel segments, as a parameter of the first.
double middle_of_overlap(const Vector3d& a0, const Vector3d& along_a, double length2_a,
                         const Vector3d& b0, const Vector3d& b1) {
  const double first = (b0 - a0).dot(along_a) / length2_a;
  const double second = (b1 - a0).dot(along_a) / length2_a;
  const double from = std::clamp(std::min(first, second), 0.0, 1.0);
  const double to = std::clamp(std::max(first, second), 0.0, 1.0);
  return 0.5 * (from + to);
}

}  // namespace

double closest_on_segment(const Vector3d& p, const Vector3d& a, const Vector3d& b) {
  const Vector3d along = b - a;
  const double length2 = along.squaredNorm();
  if (!(length2 > 0.0)) return 0.5;
  return std::clamp((p - a).dot(along) / length2, 0.0, 1.0);
}

TrianglePoint closest_on_triangle(const Vector3d& p, const Vector3d& a, const Vector3d& b,
                                  const Vector3d& c) {
  const Vector3d ab = b - a, ac = c - a, ap = p - a;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0.0 && d2 <= 0.0) return {{1.0, 0.0, 0.0}, ap};
  const Vector3d bp = p - b;
  const double d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0.0 && d4 <= d3) return {{0.0, 1.0, 0.0}, bp};
  const Vector3d cp = p - c;
  const double d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0.0 && d5 <= d6) return {{0.0, 0.0, 1.0}, cp};

  // The areas of pbc, pca and pab in the plane, from the normal: products of d1 .. d6 would cancel.
  const Vector3d normal = ab.cross(ac);
  const double area2 = normal.squaredNorm();
  const double longest2 = std::max({ab.squaredNorm(), ac.squaredNorm(), (c - b).squaredNorm()});
  if (!(area2 > 1e-24 * longest2 * longest2)) return closest_on_longest_side(p, a, b, c);
  const double va = bp.cross(cp).dot(normal), vb = cp.cross(ap).dot(normal);
  const double vc = ap.cross(bp).dot(normal);

  if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) {
    const double t = d1 / (d1 - d3);
    return point_of(p, a, b, c, {1.0 - t, t, 0.0});
  }
  if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) {
    const double t = d2 / (d2 - d6);
    return point_of(p, a, b, c, {1.0 - t, 0.0, t});
  }
  if (va <= 0.0 && d4 >= d3 && d5 >= d6) {
    const double t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return point_of(p, a, b, c, {0.0, 1.0 - t, t});
  }
  const Vector3d weight = Vector3d(va, vb, vc).cwiseMax(0.0);
  return point_of(p, a, b, c, weight / weight.sum());
}

SegmentPoints closest_on_segments(const Vector3d& a0, const Vector3d& a1, const Vector3d& b0,
                                  const Vector3d& b1) {
  const Vector3d u = a1 - a0, v = b1 - b0, w = b0 - a0;
  const double uu = u.squaredNorm(), vv = v.squaredNorm();
  const auto result = [&](double s, double t) { return SegmentPoints{s, t, s * u - w - t * v}; };
  if (!(vv > 0.0)) return result(closest_on_segment(b0, a0, a1), 0.5);
  if (!(uu > 0.0)) return result(0.5, closest_on_segment(a0, b0, b1));
  const Vector3d normal = u.cross(v);
  const double normal2 = normal.squaredNorm();
  // Nearest point of the infinite lines where they have one, and from there along the borders.
  double s = normal2 > 1e-20 * uu * vv ? std::clamp(w.cross(v).dot(normal) / normal2, 0.0, 1.0)
                                       : middle_of_overlap(a0, u, uu, b0, b1);
  double t = (s * u - w).dot(v) / vv;
  if (t < 0.0 || t > 1.0) {
    t = std::clamp(t, 0.0, 1.0);
    s = std::clamp((w + t * v).dot(u) / uu, 0.0, 1.0);
  }
  return result(s, t);
}

}  // namespace semblance
