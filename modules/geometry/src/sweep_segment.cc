#include "sweep_segment.h"

#include <algorithm>
#include <cmath>

namespace semblance {
namespace {

using Eigen::Index;

std::vector<double> heights(const SweepPanel& panel, double spacing_m) {
  std::vector<double> list;
  for (const int row : panel.rows) list.push_back(spacing_m * row);
  return list;
}

bool uses(const SweepPanel& panel, JointTangent tangent) {
  return std::find(panel.tangent.begin(), panel.tangent.end(), tangent) != panel.tangent.end();
}

void set_crease(const SweepPanel& panel, double spacing_m, Index joint, JointSlopes& slopes) {
  const Index last = panel.radius_m.rows() - 1;
  const auto chord = [&](Index i) {
    const double length_m = spacing_m * (panel.rows[i + 1] - panel.rows[i]);
    return RowF((panel.radius_m.row(i + 1) - panel.radius_m.row(i)) / static_cast<float>(length_m));
  };
  slopes.above.row(joint) = chord(std::min(joint, last - 1));
  slopes.below.row(joint) = chord(std::max<Index>(joint - 1, 0));
}

/// Per row, the product of the distances to the contours below and above: what their error grows
/// with.
std::vector<float> freedom(const SweepPanel& panel, int row_count) {
  std::vector<float> list(static_cast<std::size_t>(row_count), 0.0f);
  for (std::size_t i = 0; i + 1 < panel.rows.size(); ++i) {
    for (int row = panel.rows[i]; row < panel.rows[i + 1]; ++row) {
      list[static_cast<std::size_t>(row)] =
          static_cast<float>((row - panel.rows[i]) * (panel.rows[i + 1] - row));
    }
  }
  return list;
}

}  // namespace

RadialSweep empty_sweep(const RangeMap& map, SweepForm form) {
  RadialSweep sweep;
  sweep.form = form;
  sweep.row_count = static_cast<int>(map.rows());
  sweep.column_count = static_cast<int>(map.columns());
  sweep.bottom_m = map.bottom_m;
  sweep.spacing_m = map.spacing_m;
  sweep.world_from_map = map.world_from_map;
  return sweep;
}

JointSlopes joint_slopes(const SweepPanel& panel, double spacing_m) {
  JointSlopes slopes{panel.slope_below, panel.slope_above};
  const Index contours = panel.radius_m.rows();
  slopes.below.conservativeResize(contours, panel.radius_m.cols());
  slopes.above.conservativeResize(contours, panel.radius_m.cols());
  for (const auto& [tangent, rule] : {std::pair{JointTangent::akima, SlopeRule::akima},
                                      {JointTangent::monotone, SlopeRule::monotone},
                                      {JointTangent::natural, SlopeRule::natural}}) {
    if (!uses(panel, tangent)) continue;
    const Grid by_rule = contour_slopes(heights(panel, spacing_m), panel.radius_m, rule);
    for (Index i = 0; i < contours; ++i) {
      if (panel.tangent[i] == tangent) slopes.below.row(i) = slopes.above.row(i) = by_rule.row(i);
    }
  }
  for (Index i = 0; i < contours; ++i) {
    if (panel.tangent[i] == JointTangent::crease) set_crease(panel, spacing_m, i, slopes);
  }
  return slopes;
}

void SweepSegment::radii_at(int step, const RowF& one_plus_n, Eigen::Ref<RowF> radii) const {
  const float v = static_cast<float>(step) / static_cast<float>(length), w = 1.0f - v;
  if (form == SweepForm::cubic) {
    radii = start + (end - start) * (v * v * (3.0f - 2.0f * v)) +
            v * w * (w * start_slope - v * end_slope);
    return;
  }
  const auto rising = one_plus_n * (v * v);
  const RowF blend = rising / (rising + w * w);  // blend_flat
  if (form == SweepForm::single_scaling) {
    radii = (1.0f + v * w * (w * start_slope / start - v * end_slope / end)) *
            (start + blend * (end - start));
  } else {
    radii =
        start + blend * (end - start) + v * w * (start_slope - blend * (start_slope + end_slope));
  }
}

SweepSegment sweep_segment(const SweepPanel& panel, const JointSlopes& slopes, int index,
                           SweepForm form, double spacing_m) {
  SweepSegment segment;
  segment.form = form;
  segment.first_row = panel.rows[index];
  segment.length = panel.rows[index + 1] - panel.rows[index];
  const auto length_m = static_cast<float>(spacing_m * segment.length);
  segment.start = panel.radius_m.row(index);
  segment.end = panel.radius_m.row(index + 1);
  segment.start_slope = slopes.above.row(index) * length_m;
  segment.end_slope = slopes.below.row(index + 1) * length_m;
  return segment;
}

PanelTruth panel_truth(const RangeMap& map, int first_column, int column_count) {
  return {
      map.radius_m.middleCols(first_column, column_count),
      (map.samples.middleCols(first_column, column_count) == RangeSample::measured).cast<float>()};
}

RowF segment_errors(const SweepSegment& segment, const PanelTruth& truth, const RowF& one_plus_n,
                    ErrorNorm norm) {
  RowF sum = RowF::Zero(segment.start.size()), radii(segment.start.size());
  for (int step = 1; step < segment.length; ++step) {
    const Index row = segment.first_row + step;
    segment.radii_at(step, one_plus_n, radii);
    radii = (radii - truth.radius_m.row(row)) * truth.weight.row(row);
    sum += norm == ErrorNorm::square ? RowF(radii.square()) : RowF(radii.abs());
  }
  return sum;
}

RowF fit_segment_blend(const SweepSegment& segment, const PanelTruth& truth, BlendShare share,
                       ErrorNorm norm) {
  // A grid over log(1 + n), then finer ones around the best: the error may have several minima.
  constexpr float widest = 4.0f;
  const auto columns = segment.start.size();
  RowF best_log = RowF::Zero(columns);
  const auto errors_at = [&](const RowF& log) {
    RowF errors = segment_errors(segment, truth, log.exp(), norm);
    if (share == BlendShare::pair) errors.setConstant(errors.sum());
    return errors;
  };
  RowF best = errors_at(best_log);
  for (float reach = widest, step = 0.25f; step > 5e-5f; reach = step, step /= 4.0f) {
    const RowF centre = best_log;
    for (float offset = -reach; offset <= reach; offset += step) {
      const RowF log = (centre + offset).max(-widest).min(widest), errors = errors_at(log);
      best_log = (errors < best).select(log, best_log);
      best = best.min(errors);
    }
  }
  return best_log.exp() - 1.0f;
}

void close_seam(const RadialSweep& sweep, std::size_t seam, Grid& radii) {
  const SweepPanel& left = sweep.panels[seam];
  const SweepPanel& right = sweep.panels[(seam + 1) % sweep.panels.size()];
  const Index left_columns = left.radius_m.cols(), right_columns = right.radius_m.cols();
  if (sweep.panels.size() < 2 || left_columns < 2 || right_columns < 2) return;
  const Index l = left.first_column + left_columns - 1, r = right.first_column;
  const auto left_freedom = freedom(left, sweep.row_count),
             right_freedom = freedom(right, sweep.row_count);
  // 1 at the seam, 0 from the middle of a panel on.
  const auto fading = [](Index columns) {
    const Index reach = columns / 2;
    return RowF(1.0f - RowF::LinSpaced(reach, 0.0f, static_cast<float>(reach - 1)) /
                           static_cast<float>(reach));
  };
  const RowF left_fading = fading(left_columns).reverse(), right_fading = fading(right_columns);
  for (Index row = 0; row < radii.rows(); ++row) {
    const float a = left_freedom[static_cast<std::size_t>(row)],
                b = right_freedom[static_cast<std::size_t>(row)];
    if (a + b == 0.0f) continue;
    auto line = radii.row(row);
    // The step across the seam beyond the mean of the steps beside it.
    const float gap = line[r] - line[l] - 0.5f * (line[l] - line[l - 1] + line[r + 1] - line[r]);
    line.segment(l + 1 - left_fading.size(), left_fading.size()) += gap * a / (a + b) * left_fading;
    line.segment(r, right_fading.size()) -= gap * b / (a + b) * right_fading;
  }
}

}  // namespace semblance
