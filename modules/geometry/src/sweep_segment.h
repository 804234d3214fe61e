// Pairs of contours, and seams between panels: what evaluation and fitting share.
#pragma once

#include <cstddef>
#include <vector>

#include "semblance/geometry/radial_sweep.h"

namespace semblance {

using RowF = Eigen::Array<float, 1, Eigen::Dynamic>;

/// A sweep with the map's sizes and frame, and no panels yet.
RadialSweep empty_sweep(const RangeMap& map, SweepForm form);

/// Slopes on both sides of every contour of a panel.
struct JointSlopes {
  Grid below, above;
};
JointSlopes joint_slopes(const SweepPanel& panel, double spacing_m);

/// Two contours and their slopes dr/dv.
struct SweepSegment {
  SweepForm form = SweepForm::double_scaling;
  int first_row = 0, length = 0;  // contours lie at first_row and first_row + length
  RowF start, end, start_slope, end_slope;

  /// Radii `step` rows above the first contour, with 1 + n per column.
  void radii_at(int step, const RowF& one_plus_n, Eigen::Ref<RowF> radii) const;
};
SweepSegment sweep_segment(const SweepPanel& panel, const JointSlopes& slopes, int index,
                           SweepForm form, double spacing_m);

/// The columns of a map that a panel covers, and which of its samples count (1 or 0).
struct PanelTruth {
  Grid radius_m, weight;
};
PanelTruth panel_truth(const RangeMap& map, int first_column, int column_count);

/// The power of the errors whose sum is made small.
enum class ErrorNorm { absolute, square };

/// Sum of the errors of a segment strictly between its contours, per column.
RowF segment_errors(const SweepSegment& segment, const PanelTruth& truth, const RowF& one_plus_n,
                    ErrorNorm norm);

/// The n of a segment, per column, that make the sum of the errors smallest.
RowF fit_segment_blend(const SweepSegment& segment, const PanelTruth& truth, BlendShare share,
                       ErrorNorm norm);

/// Closes the seam between panel `seam` and the next one; no effect unless both have two columns.
void close_seam(const RadialSweep& sweep, std::size_t seam, Grid& radii);

}  // namespace semblance
