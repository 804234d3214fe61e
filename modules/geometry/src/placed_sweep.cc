#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "placement.h"
#include "semblance/core/errors.h"
#include "semblance/core/parallel.h"
#include "semblance/geometry/radial_sweep.h"
#include "sweep_segment.h"

namespace semblance {
namespace {

using Eigen::Index;

/// Differences between neighbouring rows: row i holds the slope from row i to row i + 1.
Grid row_slopes(const Grid& radius_m, double spacing_m) {
  const Index segments = radius_m.rows() - 1;
  return (radius_m.bottomRows(segments) - radius_m.topRows(segments)) /
         static_cast<float>(spacing_m);
}

/// Sums of absolute errors of all segments of a panel. Their slopes are measured inside the
/// segment, so that a contour on a crease serves both sides, and are at most three times the
/// chord's, as those found from neighbouring contours will be.
SegmentCosts segment_costs(const PanelTruth& truth, double spacing_m, int longest) {
  const auto rows = static_cast<int>(truth.radius_m.rows());
  SegmentCosts costs(rows, longest);
  const Grid slopes = row_slopes(truth.radius_m, spacing_m);
  const RowF linear = RowF::Ones(truth.radius_m.cols());  // n = 0
  SweepSegment segment;
  for (int first = 0; first < rows; ++first) {
    for (int last = first + 1; last < rows && last - first <= costs.longest(); ++last) {
      segment.first_row = first;
      segment.length = last - first;
      segment.start = truth.radius_m.row(first);
      segment.end = truth.radius_m.row(last);
      const RowF most = 3.0f * (segment.end - segment.start).abs();
      const auto length_m = static_cast<float>(spacing_m * segment.length);
      segment.start_slope = (slopes.row(first) * length_m).max(-most).min(most);
      segment.end_slope = (slopes.row(last - 1) * length_m).max(-most).min(most);
      costs.at(first, last) = segment_errors(segment, truth, linear, ErrorNorm::absolute).sum();
    }
  }
  return costs;
}

/// Numbers that a panel with so many contours takes.
std::int64_t panel_numbers(std::int64_t contours, Index columns, bool fit) {
  std::int64_t numbers = 1 + contours * (columns + 1);  // how many there are; radii and rows
  if (fit) numbers += contours + contours - 1;          // rules and n
  return numbers;
}

/// A panel's columns, and what its contours may cost.
struct PanelPlan {
  int first_column = 0;
  PanelTruth truth;
  SegmentCosts costs{fewest_range_rows, 1};
};

using Rows = std::vector<std::vector<int>>;

std::int64_t all_numbers(const std::vector<PanelPlan>& plans, const Rows& rows, bool fit) {
  std::int64_t sum = 0;
  for (std::size_t i = 0; i < plans.size(); ++i) {
    if (fit) ++sum;  // its seam
    sum += panel_numbers(static_cast<std::int64_t>(rows[i].size()), plans[i].truth.radius_m.cols(),
                         fit);
  }
  return sum;
}

/// The placement under the lowest price per contour that keeps the limit.
Rows place_within(const std::vector<PanelPlan>& plans, const PlacedSweepOptions& options) {
  const auto place = [&](double price) {
    Rows rows;
    for (const PanelPlan& plan : plans) {
      const auto columns = static_cast<double>(plan.truth.radius_m.cols());
      rows.push_back(place_contours(plan.costs, price * columns));
    }
    return rows;
  };
  // Prices in metres of error per column.
  double low = 1e-12, high = 1e6;
  Rows rows = place(high);
  if (const auto least = all_numbers(plans, rows, options.fit); least > options.numbers) {
    throw InvalidInput("sweep: " + std::to_string(options.numbers) +
                       " numbers are too few for the contours of all panels, which take at least " +
                       std::to_string(least) + "; raise the budget");
  }
  constexpr int halvings = 50;
  for (int i = 0; i < halvings; ++i) {
    const double price = std::sqrt(low * high);
    Rows trial = place(price);
    const bool fits = all_numbers(plans, trial, options.fit) <= options.numbers;
    (fits ? high : low) = price;
    if (fits) rows = std::move(trial);
  }
  return rows;
}

SweepPanel make_panel(const PanelTruth& truth, int first_column, const std::vector<int>& rows) {
  SweepPanel panel;
  panel.first_column = first_column;
  panel.rows = rows;
  panel.radius_m = truth.radius_m(rows, Eigen::all);
  panel.tangent.assign(rows.size(), JointTangent::akima);
  panel.blend = Grid::Zero(static_cast<Index>(rows.size()) - 1, 1);
  return panel;
}

/// Errors of the segments on both sides of a joint.
double joint_error(const SweepPanel& panel, const PanelTruth& truth, const JointSlopes& slopes,
                   int joint, double spacing_m) {
  const int segments = static_cast<int>(panel.rows.size()) - 1;
  const RowF linear = RowF::Ones(panel.radius_m.cols());
  double sum = 0.0;
  for (int i = std::max(joint - 1, 0); i <= std::min(joint, segments - 1); ++i) {
    const SweepSegment segment =
        sweep_segment(panel, slopes, i, SweepForm::double_scaling, spacing_m);
    sum += segment_errors(segment, truth, linear, ErrorNorm::absolute).sum();
  }
  return sum;
}

/// Gives every joint, from below, the rule that leaves the smallest error on both of its sides.
void choose_tangents(SweepPanel& panel, const PanelTruth& truth, double spacing_m) {
  constexpr std::array rules{JointTangent::akima, JointTangent::monotone, JointTangent::natural,
                             JointTangent::crease};
  std::array<JointSlopes, rules.size()> slopes;
  for (std::size_t k = 0; k < rules.size(); ++k) {
    SweepPanel uniform = panel;
    uniform.tangent.assign(panel.rows.size(), rules[k]);
    slopes[k] = joint_slopes(uniform, spacing_m);
  }
  JointSlopes chosen = slopes[0];
  for (int joint = 0; joint < static_cast<int>(panel.rows.size()); ++joint) {
    double best = std::numeric_limits<double>::infinity();
    std::size_t best_rule = 0;
    const auto take = [&](std::size_t k) {
      chosen.below.row(joint) = slopes[k].below.row(joint);
      chosen.above.row(joint) = slopes[k].above.row(joint);
    };
    for (std::size_t k = 0; k < rules.size(); ++k) {
      take(k);
      const double error = joint_error(panel, truth, chosen, joint, spacing_m);
      if (error < best) {
        best = error;
        best_rule = k;
      }
    }
    take(best_rule);
    panel.tangent[joint] = rules[best_rule];
  }
}

void fit_panel(SweepPanel& panel, const PanelTruth& truth, double spacing_m) {
  choose_tangents(panel, truth, spacing_m);
  const JointSlopes slopes = joint_slopes(panel, spacing_m);
  for (Index i = 0; i < panel.blend.rows(); ++i) {
    const SweepSegment segment =
        sweep_segment(panel, slopes, static_cast<int>(i), SweepForm::double_scaling, spacing_m);
    panel.blend(i, 0) = fit_segment_blend(segment, truth, BlendShare::pair, ErrorNorm::absolute)[0];
  }
}

/// Filled samples count a little, so that what is swept through voids stays near the filling.
PanelTruth placing_truth(const RangeMap& map, int first_column, int width) {
  constexpr float filled_weight = 0.1f;
  PanelTruth truth = panel_truth(map, first_column, width);
  truth.weight += filled_weight * (1.0f - truth.weight);
  return truth;
}

double absolute_error(const RangeMap& map, const Grid& radii) {
  return ((radii - map.radius_m).abs() * (map.samples == RangeSample::measured).cast<float>())
      .cast<double>()
      .sum();
}

/// Closes the seams that lower the sum of absolute errors.
void choose_seams(const RangeMap& map, RadialSweep& sweep) {
  Grid radii = sweep_radii(sweep);
  sweep.closed_seams.assign(sweep.panels.size(), false);
  double error = absolute_error(map, radii);
  for (std::size_t seam = 0; seam < sweep.panels.size(); ++seam) {
    Grid closed = radii;
    close_seam(sweep, seam, closed);
    const double closed_error = absolute_error(map, closed);
    if (!(closed_error < error)) continue;
    sweep.closed_seams[seam] = true;
    error = closed_error;
    radii = std::move(closed);
  }
}

/// Longer segments are not looked at: several times the mean spacing that the limit allows.
int longest_segment(const RangeMap& map, const PlacedSweepOptions& options) {
  constexpr std::int64_t times = 5, least = 64;
  const std::int64_t contours = std::max<std::int64_t>(1, options.numbers / map.columns());
  return static_cast<int>(std::clamp<std::int64_t>(times * map.rows() / contours, least,
                                                   std::max<std::int64_t>(least, map.rows() - 1)));
}

/// The table of all segments' costs, eight bytes each, must fit into memory.
void require_table_size(const RangeMap& map, std::int64_t panels, std::int64_t longest) {
  constexpr std::int64_t most = std::int64_t{1} << 28;
  if (panels * map.rows() * longest > most) {
    throw InvalidInput("sweep: " + std::to_string(map.rows()) +
                       " rows are too many to place so few contours in; raise the budget, take "
                       "wider panels, or scan with fewer rows");
  }
}

}  // namespace

RadialSweep sweep_placed(const RangeMap& map, const PlacedSweepOptions& options) {
  validate(map, "sweep");
  if ((map.samples == RangeSample::none).any()) {
    throw InvalidInput("sweep: fill the void samples of the map first");
  }
  if (options.panel_columns < 1) throw InvalidInput("sweep: a panel needs at least one column");
  const auto columns = static_cast<int>(map.columns());
  const int longest = longest_segment(map, options);
  require_table_size(map, (columns - 1) / options.panel_columns + 1, longest);
  std::vector<PanelPlan> plans;
  for (int first = 0; first < columns; first += options.panel_columns) {
    const int width = std::min(options.panel_columns, columns - first);
    plans.push_back({first, placing_truth(map, first, width)});
  }
  parallel_for(plans.size(), [&](std::size_t i) {
    plans[i].costs = segment_costs(plans[i].truth, map.spacing_m, longest);
  });
  const Rows rows = place_within(plans, options);
  RadialSweep sweep = empty_sweep(map, SweepForm::double_scaling);
  sweep.numbers_stored = all_numbers(plans, rows, options.fit);
  sweep.panels.resize(plans.size());
  parallel_for(plans.size(), [&](std::size_t i) {
    sweep.panels[i] = make_panel(plans[i].truth, plans[i].first_column, rows[i]);
    if (options.fit) fit_panel(sweep.panels[i], plans[i].truth, map.spacing_m);
  });
  if (options.fit) choose_seams(map, sweep);
  return sweep;
}

}  // namespace semblance
