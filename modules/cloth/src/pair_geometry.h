// The small pairs of contact: their closest points and how far they may move.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <limits>

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

/// Displacements of the points of a pair during a step, as they start. `bend_m` bounds the second
/// derivative of where points of the second piece are (a turn); all else goes straight.
struct PairMotion {
  std::array<Eigen::Vector3d, 3> first, second;
  double bend_m = 0.0;
};

/// First time at which room - rate t - bend t^2 / 2 is zero, for room and bend that are not
/// negative. Infinite if there is none.
inline double first_time(double room, double rate, double bend) {
  if (room <= 0.0) return 0.0;
  const double sum = rate + std::sqrt(rate * rate + 2.0 * bend * room);
  return sum > 0.0 ? 2.0 * room / sum : std::numeric_limits<double>::infinity();
}

/// Fraction of the motion after which the plane with that normal between the pieces at `pair` may
/// first have less than `room_m` between them. Infinite if it never has.
double plane_fraction(const PairPoints& pair, const PairMotion& motion,
                      const Eigen::Vector3d& normal, double room_m);

}  // namespace semblance
