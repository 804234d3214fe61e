// What a draped shape measures: Cusick's coefficient, and its distance from another one.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "semblance/cloth/sheet.h"

namespace semblance {

/// Cusick's test: a round specimen on a smaller disc, light from above (y).
struct DrapeTest {
  Eigen::Vector2d centre_m = Eigen::Vector2d::Zero();  // x and z of the disc
  double disc_radius_m = 0.09;
};

/// The shadow of a draped specimen.
struct DrapeProfile {
  /// Area of the shadow outside the disc over that of the flat specimen outside it
  /// (BS 5058, ISO 9073-9): 1 for cloth that stays flat.
  double coefficient = 0.0;
  double shadow_area_m2 = 0.0;
  /// The hem is the outline and every ray from the centre meets it once: the area is then that of a
  /// polygon. Otherwise it is counted on a grid of 4096 x 4096, right to about 1e-4.
  bool star_shaped = false;
  /// Distance of the shadow's outline from the centre, at the angles k * 2 pi / size from x to -z
  /// (counter-clockwise seen from above).
  std::vector<double> radii_m;
};

/// Measures the shadow of `sheet` at `positions_m`. Throws InvalidInput if the flat sheet does not
/// reach beyond the disc.
DrapeProfile measure_drape(const Sheet& sheet, const Points& positions_m, const DrapeTest& test);

/// Mean distance in metres between the points of the coarser shape and their counterparts on the
/// finer one, which is found by (u, v) (mirages-2006, equation (1)). Throws InvalidInput where the
/// two are not the same piece of fabric.
double shape_error_m(const Sheet& sheet_a, const Points& a_m, const Sheet& sheet_b,
                     const Points& b_m);

}  // namespace semblance
