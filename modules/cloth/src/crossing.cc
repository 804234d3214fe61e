#include "crossing.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace semblance {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double half_unit = 0x1p-53;

/// A number as an exact sum of doubles, the largest last (Shewchuk 1997). Big enough for the 24
/// products of three coordinates in a determinant, four doubles each.
class ExactSum {
 public:
  void add_product(double a, double b) {
    const auto [high, low] = product(a, b);
    add(low);
    add(high);
  }
  void add_product(double a, double b, double c) {
    const auto [high, low] = product(a, b);
    add_product(low, c);
    add_product(high, c);
  }
  int sign() const {
    if (size_ == 0) return 0;
    return parts_[size_ - 1] > 0.0 ? 1 : -1;
  }

 private:
  /// a * b = high + low, exactly (Dekker 1971).
  static std::array<double, 2> product(double a, double b) {
    const double high = a * b;
    constexpr double splitter = 0x1p27 + 1.0;
    const double a_big = splitter * a, a_high = a_big - (a_big - a), a_low = a - a_high;
    const double b_big = splitter * b, b_high = b_big - (b_big - b), b_low = b - b_high;
    return {high, a_low * b_low - (((high - a_high * b_high) - a_low * b_high) - a_high * b_low)};
  }

  void add(double value) {
    if (value == 0.0) return;
    int kept = 0;
    for (int i = 0; i < size_; ++i) {
      const double sum = value + parts_[i], part = sum - value;
      const double error = (value - (sum - part)) + (parts_[i] - part);
      value = sum;
      if (error != 0.0) parts_[kept++] = error;
    }
    size_ = kept;
    if (value != 0.0) parts_[size_++] = value;
  }

  std::array<double, 128> parts_;
  int size_ = 0;
};

/// Adds sign * det(a, b, c), rows from the origin.
void add_determinant(const Vector3d& a, const Vector3d& b, const Vector3d& c, double sign,
                     ExactSum& sum) {
  for (int k = 0; k < 3; ++k) {
    const int l = (k + 1) % 3, m = (k + 2) % 3;
    sum.add_product(sign * a[k], b[l], c[m]);
    sum.add_product(-sign * a[k], b[m], c[l]);
  }
}

int exact_orientation(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
  ExactSum sum;  // the 4 x 4 determinant with a column of ones, developed along it
  add_determinant(a, b, c, 1.0, sum);
  add_determinant(a, b, d, -1.0, sum);
  add_determinant(a, c, d, 1.0, sum);
  add_determinant(b, c, d, -1.0, sum);
  return sum.sign();
}

int exact_orientation(const Vector2d& a, const Vector2d& b, const Vector2d& c) {
  ExactSum sum;
  sum.add_product(a.x(), b.y());
  sum.add_product(-a.y(), b.x());
  sum.add_product(b.x(), c.y());
  sum.add_product(-b.y(), c.x());
  sum.add_product(c.x(), a.y());
  sum.add_product(-c.y(), a.x());
  return sum.sign();
}

int sign_of(double value) { return (value > 0.0) - (value < 0.0); }

Vector2d without(const Vector3d& point, int axis) {
  return {point[(axis + 1) % 3], point[(axis + 2) % 3]};
}

/// For a point on the line through p and q.
bool in_box(const Vector2d& point, const Vector2d& p, const Vector2d& q) {
  return point.x() >= std::min(p.x(), q.x()) && point.x() <= std::max(p.x(), q.x()) &&
         point.y() >= std::min(p.y(), q.y()) && point.y() <= std::max(p.y(), q.y());
}

bool segments_meet(const Vector2d& p, const Vector2d& q, const Vector2d& a, const Vector2d& b) {
  const int pq_a = orientation(p, q, a), pq_b = orientation(p, q, b);
  const int ab_p = orientation(a, b, p), ab_q = orientation(a, b, q);
  if (pq_a * pq_b < 0 && ab_p * ab_q < 0) return true;
  return (pq_a == 0 && in_box(a, p, q)) || (pq_b == 0 && in_box(b, p, q)) ||
         (ab_p == 0 && in_box(p, a, b)) || (ab_q == 0 && in_box(q, a, b));
}

/// Segments in one plane meet if they do so seen along all three axes: along one of them at least,
/// the view of the plane is one to one.
bool segments_meet(const Vector3d& p, const Vector3d& q, const Vector3d& a, const Vector3d& b) {
  if (orientation(p, q, a, b) != 0) return false;
  for (int axis = 0; axis < 3; ++axis)
    if (!segments_meet(without(p, axis), without(q, axis), without(a, axis), without(b, axis)))
      return false;
  return true;
}

/// For a point in the triangle's plane, by the same argument.
bool point_in_triangle(const Vector3d& p, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  bool has_area = false;
  for (int axis = 0; axis < 3; ++axis) {
    const Vector2d u = without(p, axis), i = without(a, axis), j = without(b, axis),
                   k = without(c, axis);
    const int turn = orientation(i, j, k);
    if (turn == 0) continue;
    has_area = true;
    if (turn * orientation(i, j, u) < 0 || turn * orientation(j, k, u) < 0 ||
        turn * orientation(k, i, u) < 0)
      return false;
  }
  return has_area;
}

}  // namespace

int orientation(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
  const Vector3d ad = a - d, bd = b - d, cd = c - d;
  // Flat in an axis, as cloth on a table: a difference is zero only if it is so exactly.
  for (int axis = 0; axis < 3; ++axis)
    if (ad[axis] == 0.0 && bd[axis] == 0.0 && cd[axis] == 0.0) return 0;
  const double bc = bd.x() * cd.y(), cb = cd.x() * bd.y();
  const double ca = cd.x() * ad.y(), ac = ad.x() * cd.y();
  const double ab = ad.x() * bd.y(), ba = bd.x() * ad.y();
  const double value = ad.z() * (bc - cb) + bd.z() * (ca - ac) + cd.z() * (ab - ba);
  const double size = (std::abs(bc) + std::abs(cb)) * std::abs(ad.z()) +
                      (std::abs(ca) + std::abs(ac)) * std::abs(bd.z()) +
                      (std::abs(ab) + std::abs(ba)) * std::abs(cd.z());
  const double bound = (7.0 + 56.0 * half_unit) * half_unit * size;
  if (value > bound || -value > bound) return sign_of(value);
  return exact_orientation(a, b, c, d);
}

int orientation(const Vector2d& a, const Vector2d& b, const Vector2d& c) {
  const double left = (a.x() - c.x()) * (b.y() - c.y()), right = (a.y() - c.y()) * (b.x() - c.x());
  const double bound = (3.0 + 16.0 * half_unit) * half_unit * (std::abs(left) + std::abs(right));
  const double value = left - right;
  if (value > bound || -value > bound) return sign_of(value);
  return exact_orientation(a, b, c);
}

bool segment_meets_triangle(const Vector3d& p, const Vector3d& q, const Vector3d& a,
                            const Vector3d& b, const Vector3d& c) {
  const Vector3d lower = a.cwiseMin(b).cwiseMin(c), upper = a.cwiseMax(b).cwiseMax(c);
  if ((p.cwiseMax(q).array() < lower.array()).any() ||
      (p.cwiseMin(q).array() > upper.array()).any())
    return false;
  const int at_p = orientation(a, b, c, p), at_q = orientation(a, b, c, q);
  if (at_p * at_q > 0) return false;
  if (at_p == 0 && at_q == 0)
    return segments_meet(p, q, a, b) || segments_meet(p, q, b, c) || segments_meet(p, q, c, a) ||
           point_in_triangle(p, a, b, c);
  const int ab = orientation(p, q, a, b), bc = orientation(p, q, b, c),
            ca = orientation(p, q, c, a);
  return (ab >= 0 && bc >= 0 && ca >= 0) || (ab <= 0 && bc <= 0 && ca <= 0);
}

}  // namespace semblance
