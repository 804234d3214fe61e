#include "semblance/geometry/contour_slopes.h"

#include <gmock/gmock.h>

#include <cmath>
#include <random>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

using Eigen::Index;

const std::vector<double> heights{0.0, 1.0, 1.5, 3.0, 3.2, 5.0};

Grid random_values() {
  std::mt19937 random(2);
  std::uniform_real_distribution<float> value(1.0f, 2.0f);
  return Grid::NullaryExpr(6, 4, [&] { return value(random); });
}

TEST(ContourSlopes, OneCurveHasTheSlopesOfAColumn) {
  const Grid values = random_values();
  std::vector<double> column;
  for (Index i = 0; i < 6; ++i) column.push_back(values(i, 1));
  for (const SlopeRule rule : {SlopeRule::natural, SlopeRule::monotone, SlopeRule::akima}) {
    const Eigen::ArrayXd slopes = curve_slopes(heights, column, rule);
    const Grid expected = contour_slopes(heights, values, rule);
    EXPECT_TRUE(slopes.cast<float>().isApprox(expected.col(1), 1e-6f)) << slope_rule_name(rule);
  }
  EXPECT_THROW(curve_slopes({0.0}, {1.0}, SlopeRule::monotone), InvalidInput);
  EXPECT_THROW(curve_slopes({0.0, 1.0}, {1.0}, SlopeRule::monotone), InvalidInput);
}

TEST(ContourSlopes, NaturalSplineHasContinuousCurvatureAndNoneAtItsEnds) {
  const Grid values = random_values(), slopes = contour_slopes(heights, values, SlopeRule::natural);
  // Second derivatives of Hermite's cubic at both ends of a segment.
  const auto curvature = [&](Index i, Index column, bool at_end) {
    const double h = heights[i + 1] - heights[i];
    const double chord = (values(i + 1, column) - values(i, column)) / h;
    const double a = slopes(i, column), b = slopes(i + 1, column);
    return at_end ? (2 * a + 4 * b - 6 * chord) / h : (6 * chord - 4 * a - 2 * b) / h;
  };
  for (Index column = 0; column < 4; ++column) {
    EXPECT_NEAR(curvature(0, column, false), 0.0, 1e-5);
    EXPECT_NEAR(curvature(4, column, true), 0.0, 1e-5);
    for (Index i = 1; i < 5; ++i) {
      EXPECT_NEAR(curvature(i - 1, column, true), curvature(i, column, false), 1e-4);
    }
  }
}

TEST(ContourSlopes, CatmullRomTakesTheNeighboursChord) {
  const Grid values = random_values(),
             slopes = contour_slopes(heights, values, SlopeRule::catmull_rom);
  for (Index i = 1; i < 5; ++i) {
    const double chord = (values(i + 1, 2) - values(i - 1, 2)) / (heights[i + 1] - heights[i - 1]);
    EXPECT_NEAR(slopes(i, 2), chord, 1e-6);
  }
}

TEST(ContourSlopes, MonotoneCubicIsMonotone) {
  Grid values(6, 1);
  values << 1.0f, 1.01f, 2.0f, 2.0f, 7.0f, 7.1f;
  const Grid slopes = contour_slopes(heights, values, SlopeRule::monotone);
  const Grid natural = contour_slopes(heights, values, SlopeRule::natural);
  const auto falls = [&](const Grid& slope) {
    int count = 0;
    double before = values(0, 0);
    for (Index i = 0; i < 5; ++i) {
      const double h = heights[i + 1] - heights[i];
      for (double v = 0.02; v <= 1.0; v += 0.02) {
        const double w = 1 - v;
        const double r = values(i, 0) * (1 + 2 * v) * w * w +
                         values(i + 1, 0) * v * v * (3 - 2 * v) +
                         h * v * w * (w * slope(i, 0) - v * slope(i + 1, 0));
        if (r < before - 1e-6) ++count;
        before = r;
      }
    }
    return count;
  };
  EXPECT_EQ(falls(slopes), 0);
  EXPECT_GT(falls(natural), 0);  // the data would make others overshoot
}

TEST(ContourSlopes, AkimaKeepsFlatStretchesFlatAndLinesStraight) {
  Grid values(6, 2);
  values.col(0) << 1, 1, 1, 2.5f, 2.7f, 4.5f;  // flat, then a line of slope 1
  values.col(1) = Grid::NullaryExpr(6, 1, [&](Index i) {
    return static_cast<float>(1.0 + 0.3 * heights[static_cast<std::size_t>(i)]);
  });
  const Grid slopes = contour_slopes(heights, values, SlopeRule::akima);
  for (Index i = 0; i < 3; ++i) EXPECT_NEAR(slopes(i, 0), 0.0, 1e-6) << i;
  EXPECT_NEAR(slopes(4, 0), 1.0, 1e-5);
  for (Index i = 0; i < 6; ++i) EXPECT_NEAR(slopes(i, 1), 0.3, 1e-5) << i;
}

TEST(ContourSlopes, TwoContoursGiveTheirChord) {
  Grid values(2, 1);
  values << 1.0f, 3.0f;
  for (const SlopeRule rule :
       {SlopeRule::natural, SlopeRule::catmull_rom, SlopeRule::monotone, SlopeRule::akima}) {
    const Grid slopes = contour_slopes({0.0, 4.0}, values, rule);
    EXPECT_NEAR(slopes(0, 0), 0.5, 1e-6) << slope_rule_name(rule);
    EXPECT_NEAR(slopes(1, 0), 0.5, 1e-6) << slope_rule_name(rule);
  }
}

TEST(ContourSlopes, RejectsWhatIsNoStack) {
  EXPECT_THROW(contour_slopes({0.0}, Grid::Ones(1, 3), SlopeRule::natural), InvalidInput);
  EXPECT_THROW(contour_slopes({0.0, 1.0}, Grid::Ones(3, 3), SlopeRule::natural), InvalidInput);
  EXPECT_THROW(contour_slopes({0.0, 0.0}, Grid::Ones(2, 3), SlopeRule::natural), InvalidInput);
}

}  // namespace
}  // namespace semblance
