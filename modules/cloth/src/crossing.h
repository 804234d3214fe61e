// Exact answers on crossing: signs of determinants are right for the given doubles.
#pragma once

#include <Eigen/Core>

namespace semblance {

/// Sign of det(a - d, b - d, c - d): -1, 0 or 1, exact. First in doubles with a bound on their
/// error (the filter of Shewchuk, Adaptive Precision Floating-Point Arithmetic, 1997, table 3);
/// where that does not decide, as an exact sum of doubles that do not overlap.
int orientation(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                const Eigen::Vector3d& d);

/// The same in the plane: sign of det(a - c, b - c).
int orientation(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c);

/// Whether the segment pq and the triangle abc share a point. Both are closed: touching counts, in
/// one plane too. A triangle without area is its sides.
bool segment_meets_triangle(const Eigen::Vector3d& p, const Eigen::Vector3d& q,
                            const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                            const Eigen::Vector3d& c);

}  // namespace semblance
