// Files of marked points (docs/formats/points.md).
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "semblance/core/conventions.h"

namespace semblance {

/// Our pixel coordinates from those of the iBUG 300-W annotations, which follow Matlab: the centre
/// of the first pixel is (1, 1).
inline Eigen::Vector2d ours_from_ibug(const Eigen::Vector2d& point_px) {
  return ours_from_integer_centred(point_px - Eigen::Vector2d::Ones());
}
inline Eigen::Vector2d ibug_from_ours(const Eigen::Vector2d& point_px) {
  return integer_centred_from_ours(point_px) + Eigen::Vector2d::Ones();
}

/// Points in our pixel coordinates, from a .pts file in the iBUG convention or a .json file
/// {"points": [[x, y], ...]} in ours. Throws InvalidInput naming file and line or key.
std::vector<Eigen::Vector2d> read_points(const std::string& path);
/// Writes either, by extension.
void write_points(const std::string& path, const std::vector<Eigen::Vector2d>& points_px);

}  // namespace semblance
