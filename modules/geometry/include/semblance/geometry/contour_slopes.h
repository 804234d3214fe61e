// Slopes of curves through contours, from the contours alone.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "semblance/geometry/range_map.h"

namespace semblance {

/// How a curve through values at increasing heights finds its slopes there.
enum class SlopeRule {
  null,         ///< zero: the report's null scaling function
  natural,      ///< the C2 cubic spline with no curvature at its ends
  catmull_rom,  ///< chord of the two neighbours; the end segment's chord at the ends
  monotone,     ///< Fritsch and Carlson 1980 with Fritsch and Butland's weights (1984), "PCHIP"
  akima,        ///< Akima 1970, with the weights that keep flat stretches flat (Akima 1991)
};

std::string slope_rule_name(SlopeRule rule);

/// Slopes dr/dh at `heights_m` (increasing) of curves through `values_m`, one curve per column and
/// one contour per row, each column by itself. At least two contours; throws InvalidInput.
Grid contour_slopes(const std::vector<double>& heights_m, const Grid& values_m, SlopeRule rule);
/// The same for one curve through `values` at increasing `x`, in double precision.
Eigen::ArrayXd curve_slopes(const std::vector<double>& x, const std::vector<double>& values,
                            SlopeRule rule);

}  // namespace semblance
