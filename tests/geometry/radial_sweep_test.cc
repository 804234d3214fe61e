#include "semblance/geometry/radial_sweep.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>

#include "placement.h"
#include "semblance/core/errors.h"
#include "semblance/geometry/homotopy.h"

namespace semblance {
namespace {

using Eigen::Index;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr double spacing_m = 0.01;

/// A map of a radius given in closed form over height and angle.
RangeMap make_map(int rows, int columns, const std::function<double(double, double)>& radius_m) {
  RangeMap map;
  map.spacing_m = spacing_m;
  map.radius_m.resize(rows, columns);
  map.samples = RangeMap::Samples::Constant(rows, columns, RangeSample::measured);
  for (Index row = 0; row < rows; ++row) {
    for (Index column = 0; column < columns; ++column) {
      map.radius_m(row, column) =
          static_cast<float>(radius_m(map.height_m(row), map.column_angle_rad(column)));
    }
  }
  return map;
}

double bumpy(double height, double angle) {
  return 0.1 + 0.02 * std::sin(30 * height) * std::cos(angle) +
         0.015 * std::exp(-std::pow((height - 0.3) / 0.03, 2) - angle * angle);
}

/// A sweep through `rows` of the map with slopes given in closed form.
RadialSweep sweep_with_slopes(const RangeMap& map, const std::vector<int>& rows, SweepForm form,
                              const std::function<double(double, double)>& slope) {
  RadialSweep sweep = sweep_measured(map, rows, MeasuredTangent::null, form);
  SweepPanel& panel = sweep.panels.front();
  for (std::size_t i = 0; i < rows.size(); ++i) {
    for (Index column = 0; column < map.columns(); ++column) {
      panel.slope_below(static_cast<Index>(i), column) =
          panel.slope_above(static_cast<Index>(i), column) =
              static_cast<float>(slope(map.height_m(rows[i]), map.column_angle_rad(column)));
    }
  }
  return sweep;
}

float largest_difference(const Grid& a, const Grid& b) { return (a - b).abs().maxCoeff(); }

TEST(RadialSweep, TwoScalingsReproduceQuadratics) {
  const auto radius = [](double h, double a) { return 0.2 + 0.1 * std::cos(a) * h + 0.7 * h * h; };
  const auto slope = [](double h, double a) { return 0.1 * std::cos(a) + 1.4 * h; };
  const RangeMap map = make_map(41, 16, radius);
  const RadialSweep sweep =
      sweep_with_slopes(map, {0, 7, 30, 40}, SweepForm::double_scaling, slope);
  EXPECT_LT(largest_difference(sweep_radii(sweep), map.radius_m), 2e-7f);
}

TEST(RadialSweep, CubicReproducesCubics) {
  const auto radius = [](double h, double a) {
    return 0.2 + 0.1 * h * std::sin(a) - 0.9 * h * h * h;
  };
  const auto slope = [](double h, double a) { return 0.1 * std::sin(a) - 2.7 * h * h; };
  const RangeMap map = make_map(41, 16, radius);
  const RadialSweep sweep = sweep_with_slopes(map, {0, 13, 40}, SweepForm::cubic, slope);
  EXPECT_LT(largest_difference(sweep_radii(sweep), map.radius_m), 2e-7f);
}

TEST(RadialSweep, IsTheReportsFormula) {
  // r = (1 + S)((1-R) r1 + R r2), S = v (v-1)((p0+p1) v - p0), and HomotopyPath.
  const RangeMap map = make_map(31, 8, bumpy);
  const auto slope = [](double h, double a) { return 0.3 * std::cos(50 * h) + 0.1 * a; };
  for (const double n : {-0.7, 0.0, 4.0}) {
    for (const SweepForm form : {SweepForm::single_scaling, SweepForm::double_scaling}) {
      RadialSweep sweep = sweep_with_slopes(map, {0, 12, 30}, form, slope);
      sweep.panels[0].blend.setConstant(static_cast<float>(n));
      const Grid radii = sweep_radii(sweep);
      for (Index row = 0; row < 30; ++row) {
        const int from = row < 12 ? 0 : 12, to = row < 12 ? 12 : 30;
        const double length = spacing_m * (to - from),
                     v = static_cast<double>(row - from) / (to - from);
        for (Index column = 0; column < 8; ++column) {
          const double angle = map.column_angle_rad(column);
          const double r1 = map.radius_m(from, column), r2 = map.radius_m(to, column);
          const double s1 = slope(map.height_m(from), angle) * length,
                       s2 = slope(map.height_m(to), angle) * length;
          const double p0 = s1 / r1, p1 = s2 / r2, blend = blend_flat(v, n).value;
          const double scaling = v * (v - 1) * ((p0 + p1) * v - p0);
          const double expected = form == SweepForm::single_scaling
                                      ? (1 + scaling) * ((1 - blend) * r1 + blend * r2)
                                      : HomotopyPath{r1, r2, s1, s2, n}.at(v).value;
          EXPECT_NEAR(radii(row, column), expected, 1e-7);
        }
      }
    }
  }
}

TEST(RadialSweep, PassesThroughItsContoursWithTheMeasuredTangents) {
  const RangeMap map = make_map(61, 12, bumpy);
  const std::vector<int> rows = rows_every(61, 10);
  EXPECT_THAT(rows, ElementsAre(0, 10, 20, 30, 40, 50, 60));
  EXPECT_THAT(rows_every(12, 5), ElementsAre(0, 5, 10, 11));
  const RadialSweep one_sided =
      sweep_measured(map, rows, MeasuredTangent::one_sided, SweepForm::single_scaling);
  const RadialSweep averaged =
      sweep_measured(map, rows, MeasuredTangent::averaged, SweepForm::single_scaling);
  for (const RadialSweep* sweep : {&one_sided, &averaged}) {
    const Grid radii = sweep_radii(*sweep);
    for (const int row : rows) {
      EXPECT_LT(largest_difference(radii.row(row), map.radius_m.row(row)), 1e-8f);
    }
  }
  const auto difference = [&](int from, int to) {
    return Grid((map.radius_m.row(to) - map.radius_m.row(from)) /
                static_cast<float>(spacing_m * (to - from)));
  };
  EXPECT_LT(largest_difference(one_sided.panels[0].slope_below.row(2), difference(19, 20)), 1e-5f);
  EXPECT_LT(largest_difference(one_sided.panels[0].slope_above.row(2), difference(20, 21)), 1e-5f);
  EXPECT_LT(largest_difference(averaged.panels[0].slope_below.row(2), difference(19, 21)), 1e-5f);
  EXPECT_LT(largest_difference(averaged.panels[0].slope_above.row(2), difference(19, 21)), 1e-5f);
}

TEST(RadialSweep, NullScalingWaves) {
  // A cone comes back with vertical tangents at its contours (figure 17).
  const RangeMap map = make_map(401, 4, [](double h, double) { return 5.0 - h; });
  const Grid radii = sweep_radii(
      sweep_measured(map, {0, 200, 400}, MeasuredTangent::null, SweepForm::single_scaling));
  for (const int row : {0, 200}) {
    EXPECT_LT(std::abs(radii(row + 2, 1) - radii(row, 1)), 1e-3 * 2.0);  // of 2 m per 200 rows
    EXPECT_NEAR(radii(row + 100, 1), map.radius_m(row + 100, 1), 1e-6);
    EXPECT_GT(radii(row + 50, 1), map.radius_m(row + 50, 1) + 0.2);
  }
}

TEST(RadialSweep, FindsTheBlendingParameterOfItsData) {
  const RangeMap shape = make_map(61, 8, bumpy);
  const auto slope = [](double h, double a) { return 0.2 * std::cos(40 * h + a); };
  for (const SweepForm form : {SweepForm::single_scaling, SweepForm::double_scaling}) {
    RadialSweep sweep = sweep_with_slopes(shape, {0, 20, 60}, form, slope);
    sweep.panels[0].blend.resize(2, 8);
    for (Index i = 0; i < 16; ++i) {
      sweep.panels[0].blend.data()[i] =
          static_cast<float>(std::exp(-1.8 + 0.24 * static_cast<double>(i)) - 1.0);
    }
    RangeMap map = shape;
    map.radius_m = sweep_radii(sweep);
    RadialSweep fitted = sweep;
    fitted.panels[0].blend.setZero();
    fitted.numbers_stored = 0;
    fit_blend(fitted, map, BlendShare::profile);
    EXPECT_EQ(fitted.numbers_stored, 16);
    EXPECT_LT(largest_difference(sweep_radii(fitted), map.radius_m), 2e-6f);
    for (Index i = 0; i < 16; ++i) {
      EXPECT_NEAR(std::log1p(fitted.panels[0].blend.data()[i]),
                  std::log1p(sweep.panels[0].blend.data()[i]), 2e-3);
    }
    // One n for all profiles of a pair.
    sweep.panels[0].blend = (Grid(2, 1) << 2.5f, -0.6f).finished();
    map.radius_m = sweep_radii(sweep);
    fitted.panels[0].blend = Grid::Zero(2, 1);
    fit_blend(fitted, map, BlendShare::pair);
    EXPECT_NEAR(fitted.panels[0].blend(0, 0), 2.5, 3e-3);
    EXPECT_NEAR(fitted.panels[0].blend(1, 0), -0.6, 1e-3);
    EXPECT_EQ(fitted.numbers_stored, 18);
  }
}

TEST(RadialSweep, FitIgnoresWhatWasNotMeasured) {
  const RangeMap shape = make_map(21, 6, bumpy);
  RadialSweep sweep =
      sweep_measured(shape, {0, 20}, MeasuredTangent::averaged, SweepForm::double_scaling, 1.5);
  RangeMap map = shape;
  map.radius_m = sweep_radii(sweep);
  for (Index row = 3; row < 15; ++row) {
    map.radius_m(row, 2) = 0.5f;
    map.samples(row, 2) = RangeSample::filled;
  }
  sweep.panels[0].blend.setZero();
  fit_blend(sweep, map, BlendShare::pair);
  EXPECT_NEAR(sweep.panels[0].blend(0, 0), 1.5, 2e-3);
}

TEST(RadialSweep, CountsTheNumbersStored) {
  const RangeMap map = make_map(50, 8, bumpy);
  const std::vector<int> rows = rows_equally(50, 5);
  const auto stored = [&](MeasuredTangent tangent) {
    return sweep_measured(map, rows, tangent, SweepForm::single_scaling).numbers_stored;
  };
  EXPECT_EQ(stored(MeasuredTangent::null), 5 * 8);
  EXPECT_EQ(stored(MeasuredTangent::averaged), 2 * 5 * 8);
  EXPECT_EQ(stored(MeasuredTangent::one_sided), 5 * 8 + 2 * 4 * 8);  // 8 slopes per segment end
  EXPECT_EQ(sweep_spline(map, rows, SlopeRule::natural).numbers_stored, 5 * 8);
  RadialSweep fitted =
      sweep_measured(map, rows, MeasuredTangent::averaged, SweepForm::single_scaling);
  fit_blend(fitted, map, BlendShare::profile);
  EXPECT_EQ(fitted.numbers_stored, 2 * 5 * 8 + 4 * 8);

  PlacedSweepOptions options;
  options.numbers = 200;
  options.panel_columns = 4;
  const RadialSweep placed = sweep_placed(map, options);
  std::int64_t numbers = 0;
  for (const SweepPanel& panel : placed.panels) {
    const auto contours = static_cast<std::int64_t>(panel.rows.size());
    // Whether its seam is closed; how many; radii, rows, rules, n.
    numbers += 1 + 1 + panel.radius_m.size() + contours + contours + panel.blend.size();
  }
  EXPECT_EQ(placed.numbers_stored, numbers);
  EXPECT_LE(numbers, 200);
  EXPECT_GT(numbers, 150);
  options.panel_columns = 3;  // panels of 3, 3 and 2 columns
  const RadialSweep uneven = sweep_placed(map, options);
  ASSERT_EQ(uneven.panels.size(), 3u);
  EXPECT_EQ(uneven.panels[2].radius_m.cols(), 2);
  EXPECT_LE(uneven.numbers_stored, 200);
  validate(uneven);
}

TEST(RadialSweep, PlacesContoursNoWorseThanAnyOtherChoice) {
  // All choices of inner rows, against the dynamic programme.
  constexpr int rows = 11;
  SegmentCosts costs(rows, rows - 1);
  for (int first = 0; first < rows; ++first) {
    for (int last = first + 1; last < rows; ++last) {
      const double length = last - first;
      costs.at(first, last) = length * length * (1.5 + std::sin(7.0 * first + 3.0 * last));
    }
  }
  std::map<std::size_t, double> best;  // by the number of contours
  for (unsigned inner = 0; inner < 1u << (rows - 2); ++inner) {
    double cost = 0.0;
    int last = 0;
    std::size_t contours = 2;
    for (int row = 1; row < rows; ++row) {
      if (row < rows - 1 && !(inner >> (row - 1) & 1)) continue;
      cost += costs.at(last, row);
      last = row;
      if (row < rows - 1) ++contours;
    }
    const auto found = best.try_emplace(contours, cost).first;
    found->second = std::min(found->second, cost);
  }
  std::size_t before = rows + 1;
  for (double price = 0.01; price < 1e3; price *= 1.3) {
    const std::vector<int> placed = place_contours(costs, price);
    double cost = 0.0;
    for (std::size_t i = 0; i + 1 < placed.size(); ++i) cost += costs.at(placed[i], placed[i + 1]);
    EXPECT_NEAR(cost, best.at(placed.size()), 1e-9) << placed.size() << " contours";
    EXPECT_LE(placed.size(), before);
    before = placed.size();
  }
  EXPECT_EQ(before, 2u);
}

TEST(RadialSweep, FullMethodKeepsCreasesAndJumps) {
  // A cylinder, a step outwards, then a roof: five contours say it all.
  const RangeMap map = make_map(80, 32, [](double h, double) {
    const double row = h / spacing_m;
    return row < 29.5 ? 0.1 : row < 55.5 ? 0.2 + 0.001 * (row - 30) : 0.225 - 0.002 * (row - 55);
  });
  PlacedSweepOptions options;
  options.numbers = 1 + 5 * (32 + 3);  // seam, how many, and one n fewer than contours
  const RadialSweep sweep = sweep_placed(map, options);
  EXPECT_THAT(sweep.panels[0].rows, ElementsAre(0, 29, 30, 55, 79));
  EXPECT_LT(largest_difference(sweep_radii(sweep), map.radius_m), 1e-6f);
  EXPECT_EQ(sweep.panels[0].tangent[3], JointTangent::crease);
}

TEST(RadialSweep, FullMethodBeatsSplinesOnLocalFeatures) {
  // A smooth body with a nose: what is far from it need not be stored as densely.
  const RangeMap map = make_map(128, 64, [](double h, double angle) {
    return 0.1 + 0.03 * std::sin(4 * h) +
           0.03 * std::exp(-std::pow((h - 0.5) / 0.05, 2) - 6 * angle * angle);
  });
  PlacedSweepOptions options;
  options.numbers = 10 * 64;
  options.panel_columns = 16;
  const RadialSweep placed = sweep_placed(map, options);
  const RadialSweep spline = sweep_spline(map, rows_equally(128, 10), SlopeRule::natural);
  EXPECT_LE(placed.numbers_stored, spline.numbers_stored);
  const double full = radial_error(map, sweep_radii(placed)).mean_m;
  EXPECT_LT(full, 0.7 * radial_error(map, sweep_radii(spline)).mean_m);
  options.fit = false;
  EXPECT_LT(full, radial_error(map, sweep_radii(sweep_placed(map, options))).mean_m);
}

TEST(RadialSweep, ClosesSeamsWithoutMovingContours) {
  // A bump on one side draws contours there.
  const RangeMap map = make_map(60, 40, [](double h, double angle) {
    return bumpy(h, angle) +
           0.02 * std::exp(-std::pow((h - 0.15) / 0.04, 2) - 4 * std::pow(angle - 1, 2));
  });
  PlacedSweepOptions options;
  options.panel_columns = 20;
  options.numbers = 2 * (2 + 7 * (20 + 3) - 1);
  RadialSweep sweep = sweep_placed(map, options);
  sweep.closed_seams = {false, false};
  const Grid open = sweep_radii(sweep);
  sweep.closed_seams = {true, false};
  const Grid closed = sweep_radii(sweep);
  const auto gap = [&](const Grid& radii, Index row) {
    return radii(row, 20) - radii(row, 19) -
           0.5f * (radii(row, 19) - radii(row, 18) + radii(row, 21) - radii(row, 20));
  };
  int moved = 0;
  for (Index row = 0; row < 60; ++row) {
    for (const SweepPanel& panel : sweep.panels) {
      if (std::find(panel.rows.begin(), panel.rows.end(), row) == panel.rows.end()) continue;
      const Index first = panel.first_column;
      EXPECT_LT(largest_difference(closed.row(row).segment(first, 20),
                                   map.radius_m.row(row).segment(first, 20)),
                1e-8f);
    }
    if (std::abs(closed(row, 19) - open(row, 19)) + std::abs(closed(row, 20) - open(row, 20)) >
        1e-6f) {
      ++moved;
      // All of the step goes but what the fading over ten columns brings in beside the seam.
      EXPECT_LT(std::abs(gap(closed, row)), 0.11f * std::abs(gap(open, row)) + 1e-7f) << row;
    }
  }
  EXPECT_GT(moved, 20);
  EXPECT_EQ(largest_difference(closed.leftCols(10), open.leftCols(10)), 0.0f);
  EXPECT_EQ(largest_difference(closed.rightCols(10), open.rightCols(10)), 0.0f);
}

TEST(RadialSweep, ErrorIsOverMeasuredSamples) {
  RangeMap map = make_map(10, 10, [](double, double) { return 0.1; });
  Grid radii = map.radius_m;
  radii.row(0) += 0.001f;
  radii.row(1) -= 0.003f;
  radii(5, 5) = 9.0f;
  map.samples(5, 5) = RangeSample::filled;
  const RadialError error = radial_error(map, radii);
  EXPECT_NEAR(error.mean_m, (10 * 0.001 + 10 * 0.003) / 99, 1e-8);
  EXPECT_NEAR(error.rms_m, std::sqrt((10 * 1e-6 + 10 * 9e-6) / 99), 1e-8);
  EXPECT_NEAR(error.percentile95_m, 0.003, 1e-8);
  EXPECT_NEAR(error.largest_m, 0.003, 1e-8);
}

TEST(RadialSweep, RejectsWhatCannotBeSwept) {
  const RangeMap map = make_map(20, 8, bumpy);
  EXPECT_THAT([] { rows_every(20, 20); },
              ThrowsMessage<InvalidInput>(HasSubstr("between 1 and 19")));
  EXPECT_THROW(rows_every(20, 0), InvalidInput);
  EXPECT_THROW(rows_equally(20, 1), InvalidInput);
  const auto measured = [&](const std::vector<int>& rows, double n) {
    sweep_measured(map, rows, MeasuredTangent::null, SweepForm::single_scaling, n);
  };
  EXPECT_THROW(measured({0, 10}, 0.0), InvalidInput);
  EXPECT_THROW(measured({0, 10, 10, 19}, 0.0), InvalidInput);
  EXPECT_THAT([&] { measured({0, 19}, -1.0); }, ThrowsMessage<InvalidInput>(HasSubstr("above -1")));
  EXPECT_THROW(measured({0, 19}, std::numeric_limits<double>::infinity()), InvalidInput);
  PlacedSweepOptions options;
  options.panel_columns = 4;
  options.numbers = 2 * 15 - 1;  // less than two panels of two contours take
  EXPECT_THAT([&] { sweep_placed(map, options); },
              ThrowsMessage<InvalidInput>(HasSubstr("raise the budget")));
  options.panel_columns = 0;
  EXPECT_THROW(sweep_placed(map, options), InvalidInput);
  RangeMap with_void = map;
  with_void.samples(3, 3) = RangeSample::none;
  with_void.radius_m(3, 3) = 0.0f;
  EXPECT_THAT([&] { sweep_placed(with_void, {}); },
              ThrowsMessage<InvalidInput>(HasSubstr("fill the void")));
  EXPECT_THROW(radial_error(map, Grid::Ones(3, 3)), InvalidInput);
}

}  // namespace
}  // namespace semblance
