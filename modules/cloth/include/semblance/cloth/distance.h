// Closest points of the small pieces of triangle meshes.
#pragma once

#include <Eigen/Core>

namespace semblance {

/// Closest point of a triangle to a point, as weights of its corners (not negative, sum 1).
struct TrianglePoint {
  Eigen::Vector3d weight;
  Eigen::Vector3d offset_m;  // from that point to the given one
};

/// Closest points of two segments: a0 + s (a1 - a0) and b0 + t (b1 - b0), s and t in [0, 1].
struct SegmentPoints {
  double s, t;
  Eigen::Vector3d offset_m;  // from the point of b to that of a
};

/// Closest point of the triangle abc to p (the regions of Ericson, Real-Time Collision Detection,
/// 5.1.5). A triangle without area counts as its longest side.
TrianglePoint closest_on_triangle(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                  const Eigen::Vector3d& b, const Eigen::Vector3d& c);

/// Parameter in [0, 1] of the point of the segment ab closest to p; 1/2 if a equals b.
double closest_on_segment(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                          const Eigen::Vector3d& b);

/// Closest points of the segments a0 a1 and b0 b1, of any length and direction. The distance is
/// right for parallel segments too; of their many closest pairs the one in the middle is taken.
SegmentPoints closest_on_segments(const Eigen::Vector3d& a0, const Eigen::Vector3d& a1,
                                  const Eigen::Vector3d& b0, const Eigen::Vector3d& b1);

}  // namespace semblance
