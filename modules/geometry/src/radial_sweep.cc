#include "semblance/geometry/radial_sweep.h"

#include <algorithm>
#include <cmath>

#include "semblance/core/errors.h"
#include "semblance/core/parallel.h"
#include "sweep_segment.h"

namespace semblance {
namespace {

using Eigen::Index;

[[noreturn]] void fail(const std::string& what) { throw InvalidInput("sweep: " + what); }

bool same_size(const Grid& grid, Index rows, Index columns) {
  return grid.rows() == rows && grid.cols() == columns;
}

void check_rows(const std::vector<int>& rows, int row_count) {
  if (rows.size() < 2 || rows.front() != 0 || rows.back() != row_count - 1) {
    fail("at least two contours are needed, the first in row 0 and the last in row " +
         std::to_string(row_count - 1) + "; choose them closer together");
  }
  if (std::adjacent_find(rows.begin(), rows.end(), std::greater_equal<>()) != rows.end()) {
    fail("the rows of the contours must increase");
  }
}

void check_panel(const SweepPanel& panel, int row_count) {
  check_rows(panel.rows, row_count);
  const auto contours = static_cast<Index>(panel.rows.size()), columns = panel.radius_m.cols();
  const bool given = std::find(panel.tangent.begin(), panel.tangent.end(), JointTangent::given) !=
                     panel.tangent.end();
  const Index slopes = given ? contours : panel.slope_below.rows();
  const bool sizes =
      same_size(panel.radius_m, contours, columns) &&
      static_cast<Index>(panel.tangent.size()) == contours &&
      (slopes == 0 || (same_size(panel.slope_below, contours, columns) &&
                       same_size(panel.slope_above, contours, columns))) &&
      (same_size(panel.blend, contours - 1, 1) || same_size(panel.blend, contours - 1, columns));
  if (!sizes || columns == 0) fail("radii, tangents, slopes and n of a panel differ in size");
  if (!(panel.radius_m > 0.0f).all() || !panel.radius_m.isFinite().all()) {
    fail("a contour has a radius that is not finite and positive; fill void samples first");
  }
  if (!panel.slope_below.isFinite().all() || !panel.slope_above.isFinite().all()) {
    fail("a slope is not finite");
  }
  if (!(panel.blend > -1.0f).all() || !panel.blend.isFinite().all()) {
    fail("a blending parameter n is not finite and above -1");
  }
}

void sweep_panel(const RadialSweep& sweep, const SweepPanel& panel, Grid& radii) {
  const JointSlopes slopes = joint_slopes(panel, sweep.spacing_m);
  const Index columns = panel.radius_m.cols();
  RowF row(columns), one_plus_n(columns);
  for (int i = 0; i + 1 < static_cast<int>(panel.rows.size()); ++i) {
    const SweepSegment segment = sweep_segment(panel, slopes, i, sweep.form, sweep.spacing_m);
    one_plus_n = panel.blend.row(i).replicate(1, columns / panel.blend.cols()) + 1.0f;
    for (int step = 0; step < segment.length; ++step) {
      segment.radii_at(step, one_plus_n, row);
      radii.row(segment.first_row + step).segment(panel.first_column, columns) = row;
    }
  }
  radii.row(sweep.row_count - 1).segment(panel.first_column, columns) =
      panel.radius_m.row(panel.radius_m.rows() - 1);
}

/// One panel over all columns, with slopes to be set.
RadialSweep whole_contours(const RangeMap& map, const std::vector<int>& rows, SweepForm form) {
  validate(map, "sweep");
  check_rows(rows, static_cast<int>(map.rows()));
  RadialSweep sweep = empty_sweep(map, form);
  const auto contours = static_cast<Index>(rows.size());
  SweepPanel panel;
  panel.rows = rows;
  panel.radius_m = map.radius_m(rows, Eigen::all);
  panel.tangent.assign(rows.size(), JointTangent::given);
  panel.slope_below = panel.slope_above = Grid::Zero(contours, map.columns());
  panel.blend = Grid::Zero(contours - 1, 1);
  sweep.panels.push_back(std::move(panel));
  sweep.numbers_stored = contours * map.columns();
  return sweep;
}

/// Differences to the rows below and above, as far as there are any.
void measure_slopes(const RangeMap& map, const std::vector<int>& rows, SweepPanel& panel) {
  const Index last = map.rows() - 1;
  const auto difference = [&](Index row) {
    return RowF((map.radius_m.row(row + 1) - map.radius_m.row(row)) /
                static_cast<float>(map.spacing_m));
  };
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Index row = rows[i], joint = static_cast<Index>(i);
    panel.slope_below.row(joint) = difference(std::max<Index>(row - 1, 0));
    panel.slope_above.row(joint) = difference(std::min(row, last - 1));
  }
}

}  // namespace

double RadialSweep::mean_contours() const {
  double sum = 0.0;
  for (const SweepPanel& panel : panels) {
    sum += static_cast<double>(panel.rows.size()) * static_cast<double>(panel.radius_m.cols());
  }
  return sum / column_count;
}

void validate(const RadialSweep& sweep) {
  const int most = static_cast<int>(most_range_samples_per_side);
  if (sweep.row_count < fewest_range_rows || sweep.row_count > most ||
      sweep.column_count < fewest_range_columns || sweep.column_count > most) {
    fail(std::to_string(sweep.row_count) + " rows and " + std::to_string(sweep.column_count) +
         " columns; from 2 x 3 to 8192 x 8192 were expected");
  }
  if (!(sweep.spacing_m > 0.0) || !std::isfinite(sweep.spacing_m) ||
      !std::isfinite(sweep.bottom_m)) {
    fail("a finite lowest height and a positive spacing of the rows are needed");
  }
  Index column = 0;
  for (const SweepPanel& panel : sweep.panels) {
    if (panel.first_column != column) fail("the panels must cover the columns in order");
    check_panel(panel, sweep.row_count);
    column += panel.radius_m.cols();
  }
  if (column != sweep.column_count) fail("the panels must cover all columns");
  if (!sweep.closed_seams.empty() && sweep.closed_seams.size() != sweep.panels.size()) {
    fail("there must be as many seams as panels");
  }
}

Grid sweep_radii(const RadialSweep& sweep) {
  validate(sweep);
  Grid radii(sweep.row_count, sweep.column_count);
  for (const SweepPanel& panel : sweep.panels) sweep_panel(sweep, panel, radii);
  for (std::size_t seam = 0; seam < sweep.closed_seams.size(); ++seam) {
    if (sweep.closed_seams[seam]) close_seam(sweep, seam, radii);
  }
  return radii;
}

RangeMap swept_map(const RadialSweep& sweep) {
  RangeMap map;
  map.bottom_m = sweep.bottom_m;
  map.spacing_m = sweep.spacing_m;
  map.world_from_map = sweep.world_from_map;
  map.radius_m = sweep_radii(sweep);
  const auto usable = (map.radius_m > 0.0f && map.radius_m.isFinite()).eval();
  map.radius_m = usable.select(map.radius_m, 0.0f);
  map.samples = RangeMap::Samples::Constant(sweep.row_count, sweep.column_count, RangeSample::none);
  map.samples = usable.select(RangeSample::measured, map.samples);
  return map;
}

std::vector<int> rows_every(int row_count, int step) {
  if (step < 1 || step > row_count - 1) {
    fail("contours every " + std::to_string(step) + " of " + std::to_string(row_count) +
         " rows leave fewer than two; choose between 1 and " + std::to_string(row_count - 1));
  }
  std::vector<int> rows;
  for (int row = 0; row < row_count - 1; row += step) rows.push_back(row);
  rows.push_back(row_count - 1);
  return rows;
}

std::vector<int> rows_equally(int row_count, int count) {
  if (count < 2 || count > row_count) {
    fail(std::to_string(count) + " contours were asked for; choose between 2 and " +
         std::to_string(row_count) + ", the number of rows");
  }
  std::vector<int> rows;
  for (int i = 0; i < count; ++i) {
    rows.push_back(
        static_cast<int>(std::lround(static_cast<double>(i) * (row_count - 1) / (count - 1))));
  }
  return rows;
}

RadialSweep sweep_measured(const RangeMap& map, const std::vector<int>& rows,
                           MeasuredTangent tangent, SweepForm form, double n) {
  RadialSweep sweep = whole_contours(map, rows, form);
  SweepPanel& panel = sweep.panels.front();
  panel.blend.setConstant(static_cast<float>(n));
  if (tangent != MeasuredTangent::null) {
    measure_slopes(map, rows, panel);
    const bool averaged = tangent == MeasuredTangent::averaged;
    if (averaged) {
      panel.slope_below = 0.5f * (panel.slope_below + panel.slope_above);
      panel.slope_above = panel.slope_below;
    }
    // The lowest contour needs no slope below it, the highest none above.
    const std::int64_t slopes =
        averaged ? panel.slope_below.size() : 2 * (panel.slope_below.size() - map.columns());
    sweep.numbers_stored += slopes;
  }
  validate(sweep);
  return sweep;
}

RadialSweep sweep_spline(RadialSweep sweep, SlopeRule rule) {
  sweep.form = SweepForm::cubic;
  for (SweepPanel& panel : sweep.panels) {
    std::vector<double> heights_m;
    for (const int row : panel.rows) heights_m.push_back(sweep.spacing_m * row);
    panel.slope_below = panel.slope_above = contour_slopes(heights_m, panel.radius_m, rule);
    panel.tangent.assign(panel.rows.size(), JointTangent::given);
  }
  validate(sweep);
  return sweep;
}

RadialSweep sweep_spline(const RangeMap& map, const std::vector<int>& rows, SlopeRule rule) {
  return sweep_spline(whole_contours(map, rows, SweepForm::cubic), rule);
}

void fit_blend(RadialSweep& sweep, const RangeMap& map, BlendShare share) {
  validate(sweep);
  for (SweepPanel& panel : sweep.panels) {
    const auto columns = static_cast<int>(panel.radius_m.cols());
    const PanelTruth truth = panel_truth(map, panel.first_column, columns);
    const JointSlopes slopes = joint_slopes(panel, sweep.spacing_m);
    const Index segments = panel.blend.rows();
    Grid blend(segments, share == BlendShare::pair ? 1 : columns);
    parallel_for(static_cast<std::size_t>(segments), [&](std::size_t i) {
      const SweepSegment segment =
          sweep_segment(panel, slopes, static_cast<int>(i), sweep.form, sweep.spacing_m);
      const RowF n = fit_segment_blend(segment, truth, share, ErrorNorm::square);
      blend.row(static_cast<Index>(i)) = n.head(blend.cols());
    });
    panel.blend = std::move(blend);
    sweep.numbers_stored += panel.blend.size();
  }
}

RadialError radial_error(const RangeMap& map, const Grid& radius_m) {
  if (!same_size(radius_m, map.rows(), map.columns())) {
    fail("the radii to compare differ from the map in size");
  }
  std::vector<double> errors;
  double square = 0.0, sum = 0.0;
  for (Index i = 0; i < radius_m.size(); ++i) {
    if (map.samples.data()[i] != RangeSample::measured) continue;
    const double error = std::abs(static_cast<double>(radius_m.data()[i]) - map.radius_m.data()[i]);
    errors.push_back(error);
    sum += error;
    square += error * error;
  }
  if (errors.empty()) fail("the map has no measured sample to compare with");
  const auto count = static_cast<double>(errors.size());
  const auto at95 = errors.begin() + static_cast<std::ptrdiff_t>(0.95 * (count - 1.0));
  std::nth_element(errors.begin(), at95, errors.end());
  const double percentile95 = *at95;
  return {sum / count, std::sqrt(square / count), percentile95,
          *std::max_element(errors.begin(), errors.end())};
}

}  // namespace semblance
