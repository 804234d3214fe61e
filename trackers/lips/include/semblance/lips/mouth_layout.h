// Which dot is which: the arrangement of markers around a mouth (order: io/lip_markers.h).
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "semblance/lips/dots.h"

namespace semblance {

/// Markers of a known number of places, by their place on the mouth: entry i is the index of marker
/// i among `points`. The two outer corners are the ends; with 16, the inner corners are next to
/// them; all others stand in three columns of two or four, from the upper to the lower lip. That
/// order survives everything lips do but rolling one over the other, and needs no shape to compare
/// with. Nothing where the points do not stand so: other than 8 or 16 points, columns that are not
/// apart, dots of a column closer than `least_gap_px`, or corners on a line more than 50 degrees
/// off the horizontal.
std::optional<std::vector<int>> order_markers(const std::vector<Eigen::Vector2d>& points_px,
                                              double least_gap_px);

/// `count` spots of one size and colour that stand like the markers of a mouth, in their order; the
/// most alike where there are several such sets. Empty where there is none.
std::vector<Spot> find_constellation(const std::vector<Spot>& spots, int count);

/// Whether known markers stand in the order of a mouth: along the rows from left to right and down
/// the columns. `known[i]` says whether entry i has a place.
bool in_mouth_order(const std::vector<Eigen::Vector2d>& markers_px, const std::vector<bool>& known);

/// An affine map of the plane.
struct PlaneMap {
  Eigen::Matrix2d turn = Eigen::Matrix2d::Identity();
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();
  Eigen::Vector2d operator()(const Eigen::Vector2d& p) const { return turn * p + shift; }
};

/// The map that takes `from` closest to `to` (least squares): affine from six pairs that are spread
/// in both directions on, a shift with fewer. Needs one pair.
PlaneMap fit_map(const std::vector<Eigen::Vector2d>& from_px,
                 const std::vector<Eigen::Vector2d>& to_px);

/// The similarity (turn, scale, shift) that does so; a shift with one pair, or where all of `from`
/// are at one place.
PlaneMap fit_turn(const std::vector<Eigen::Vector2d>& from_px,
                  const std::vector<Eigen::Vector2d>& to_px);

}  // namespace semblance
