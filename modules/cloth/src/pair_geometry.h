// The small pairs of contact: their closest points and how far they may move.
#pragma once

#include <Eigen/Core>
#include <array>

namespace semblance {

/// Two convex pieces, a point, a segment or a triangle each: 1 + 3, 2 + 2 or 3 + 1 points.
struct PairPoints {
  int first_count, second_count;
  std::array<Eigen::Vector3d, 3> first, second;
};

struct PairClosest {
  Eigen::Vector3d offset_m;  // first minus second
  std::array<double, 3> first{}, second{};
};

PairClosest closest_points(const PairPoints& pair);

/// Straight displacements of the points of a pair during a step. `excess_m` bounds what points of
/// the second piece move besides (a turn).
struct PairMotion {
  std::array<Eigen::Vector3d, 3> first, second;
  double excess_m = 0.0;
};

/// Fraction of the motion after which the plane with that normal between the pieces at `pair` may
/// first have less than `room_m` between them. Infinite if it never has.
double plane_fraction(const PairPoints& pair, const PairMotion& motion,
                      const Eigen::Vector3d& normal, double room_m);

}  // namespace semblance
