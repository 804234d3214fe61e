// Range maps stored as few contours and swept back: ATR TR-C-0089 (1993), sections 3.1 to 3.3.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "semblance/geometry/contour_slopes.h"
#include "semblance/geometry/range_map.h"

namespace semblance {

/// What joins two contours r1, r2 with slopes: v runs from 0 to 1, R is blend_flat(v, n).
enum class SweepForm {
  /// (1 + S)((1-R) r1 + R r2) with the cubic S = v (v-1) ((p0+p1) v - p0), p_i = slope_i / r_i: the
  /// report's static form (sections 3.1.1 and 3.2.4). It does not reproduce straight profiles.
  single_scaling,
  /// HomotopyPath: one scaling function per contour, as the report has it for motion
  /// (section 4.3.1).
  /// Reproduces quadratics for n = 0.
  double_scaling,
  /// Hermite's cubic, for the splines that sweeps are compared with. n has no effect.
  cubic,
};

/// How a joint of a stored panel finds its tangents.
enum class JointTangent : std::uint8_t {
  given,     ///< the panel's own slopes below and above
  akima,     ///< from the neighbouring contours (SlopeRule::akima)
  monotone,  ///< likewise (SlopeRule::monotone)
  natural,   ///< likewise (SlopeRule::natural)
  crease,    ///< each side keeps its chord
};

/// Contours over neighbouring columns, from the first row of the map to the last.
struct SweepPanel {
  int first_column = 0;
  std::vector<int> rows;              // of the contours, increasing
  Grid radius_m;                      // contours x columns
  std::vector<JointTangent> tangent;  // per contour
  Grid slope_below, slope_above;      // dr/dh; empty unless some tangent is given
  Grid blend;  // n per segment: segments x 1, or x columns for one per profile
};

/// A range map as panels that cover its columns, and what they cost to store.
struct RadialSweep {
  SweepForm form = SweepForm::double_scaling;
  int row_count = 0, column_count = 0;
  double bottom_m = 0.0, spacing_m = 0.0;  // heights and frame are the map's
  Rigid3 world_from_map;
  std::vector<SweepPanel> panels;
  /// Whether the seam between a panel and the next one, around the axis, is closed; empty: none is.
  /// What both sides miss there moves them towards each other, most at the seam and nothing from
  /// the panels' middles on, shared by how far either side is from its own contours.
  std::vector<bool> closed_seams;
  /// Numbers that have to be kept to sweep again, beyond sizes: radii; measured slopes (once where
  /// both sides agree); rows unless equally spaced; rules, n and closed seams where they were
  /// chosen.
  std::int64_t numbers_stored = 0;

  /// Contours in the mean over the columns.
  double mean_contours() const;
};

/// Throws InvalidInput unless rows and columns are in a range map's range, the panels cover the
/// columns in order, every panel's rows increase from the first row to the last, sizes agree, every
/// radius is positive and finite, and n > -1.
void validate(const RadialSweep& sweep);

/// The whole map of radii, row_count x column_count.
Grid sweep_radii(const RadialSweep& sweep);

/// The same as a range map in the frame of the one that was stored. A path that overshoots beyond
/// the axis leaves a void sample; all others count as measured.
RangeMap swept_map(const RadialSweep& sweep);

/// Rows 0, step, 2 step, ... and the last one. Throws InvalidInput if fewer than two contours would
/// be left or step < 1.
std::vector<int> rows_every(int row_count, int step);
/// `count` rows from the first to the last, as equally spaced as whole numbers allow.
std::vector<int> rows_equally(int row_count, int count);

/// The tangents that the report measures on the digitized contours next to a stored one.
enum class MeasuredTangent {
  null,       ///< vertical: figure 17
  one_sided,  ///< each side its own difference, figure 19
  averaged,   ///< the mean of both, figure 20
};

/// Contours at `rows`, the first and the last among them, with tangents measured on the map and one
/// n for all. Void samples must have been filled.
RadialSweep sweep_measured(const RangeMap& map, const std::vector<int>& rows,
                           MeasuredTangent tangent, SweepForm form, double n = 0.0);
/// A spline through the contours at `rows`.
RadialSweep sweep_spline(const RangeMap& map, const std::vector<int>& rows, SlopeRule rule);
/// A spline through the contours of another sweep, whose tangents and n it leaves.
RadialSweep sweep_spline(RadialSweep sweep, SlopeRule rule);

enum class BlendShare { pair, profile };

/// Chooses n > -1 by least squares against the measured samples, one per pair of contours or one
/// per pair and profile (report, section 3.3.1). n stays within [e^-4 - 1, e^4 - 1]; it is 0 where
/// no measured sample lies between the contours.
void fit_blend(RadialSweep& sweep, const RangeMap& map, BlendShare share);

struct PlacedSweepOptions {
  std::int64_t numbers = 0;  // upper limit on RadialSweep::numbers_stored
  int panel_columns = 32;    // of each panel, but for the last one where they do not divide
  bool fit = true;           // choose tangents, n and seams; else Akima's rule, n = 0, none closed
};

/// The full method. Dynamic programming places contours, panel by panel, where they lower the sum
/// of absolute errors most per number (filled samples count a tenth), with tangents measured on the
/// map and one price per contour for all panels, such that the limit is kept. Then every joint's
/// rule, every segment's n and the seams to close are chosen in turn for the smallest sum. Throws
/// InvalidInput if the limit is too small for two contours per panel, or if the map has too many
/// rows for so few contours (more than 2 GiB of segment costs).
RadialSweep sweep_placed(const RangeMap& map, const PlacedSweepOptions& options);

/// Radial errors over the measured samples.
struct RadialError {
  double mean_m = 0.0, rms_m = 0.0, percentile95_m = 0.0, largest_m = 0.0;
};
RadialError radial_error(const RangeMap& map, const Grid& radius_m);

}  // namespace semblance
