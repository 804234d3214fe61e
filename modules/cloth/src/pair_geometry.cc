#include "pair_geometry.h"

#include <algorithm>

#include "semblance/cloth/distance.h"

namespace semblance {

PairClosest closest_points(const PairPoints& pair) {
  PairClosest result;
  const auto &a = pair.first, &b = pair.second;
  if (pair.first_count == 2) {
    const SegmentPoints points = closest_on_segments(a[0], a[1], b[0], b[1]);
    result.offset_m = points.offset_m;
    result.first = {1.0 - points.s, points.s, 0.0};
    result.second = {1.0 - points.t, points.t, 0.0};
  } else if (pair.first_count == 1) {
    const TrianglePoint point = closest_on_triangle(a[0], b[0], b[1], b[2]);
    result.offset_m = point.offset_m;
    result.first = {1.0, 0.0, 0.0};
    result.second = {point.weight[0], point.weight[1], point.weight[2]};
  } else {
    const TrianglePoint point = closest_on_triangle(b[0], a[0], a[1], a[2]);
    result.offset_m = -point.offset_m;
    result.first = {point.weight[0], point.weight[1], point.weight[2]};
    result.second = {1.0, 0.0, 0.0};
  }
  return result;
}

double plane_fraction(const PairPoints& pair, const PairMotion& motion,
                      const Eigen::Vector3d& normal, double room_m) {
  std::array<double, 3> height, closing;
  for (int j = 0; j < pair.second_count; ++j) {
    height[j] = normal.dot(pair.second[j]);
    closing[j] = normal.dot(motion.second[j]);
  }
  double fraction = std::numeric_limits<double>::infinity();
  for (int i = 0; i < pair.first_count; ++i) {
    const double above = normal.dot(pair.first[i]), falling = -normal.dot(motion.first[i]);
    for (int j = 0; j < pair.second_count; ++j)
      fraction = std::min(
          fraction, first_time(above - height[j] - room_m, falling + closing[j], motion.bend_m));
  }
  return fraction;
}

}  // namespace semblance
