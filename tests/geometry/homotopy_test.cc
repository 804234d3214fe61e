#include "semblance/geometry/homotopy.h"

#include <gmock/gmock.h>

#include <cmath>
#include <functional>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

constexpr double n_values[] = {-0.9, -0.5, 0.0, 2.0, 9.0};

void expect_slope_is_difference(const std::function<ValueSlope(double)>& f) {
  const double h = 1e-6;
  for (double v = 0.01; v < 1.0; v += 0.07) {
    const double difference = (f(v + h).value - f(v - h).value) / (2.0 * h);
    EXPECT_NEAR(f(v).slope, difference, 1e-6 * (1.0 + std::abs(difference))) << "at v = " << v;
  }
}

TEST(Blend, RunsMonotonouslyFromZeroToOne) {
  for (const double n : n_values) {
    for (const auto blend : {blend_rational, blend_flat}) {
      EXPECT_EQ(blend(0.0, n).value, 0.0);
      EXPECT_NEAR(blend(1.0, n).value, 1.0, 1e-15);
      double before = 0.0;
      for (double v = 0.05; v < 1.0; v += 0.05) {
        EXPECT_GT(blend(v, n).value, before);
        before = blend(v, n).value;
      }
      expect_slope_is_difference([&](double v) { return blend(v, n); });
    }
    EXPECT_EQ(blend_flat(0.0, n).slope, 0.0);
    EXPECT_EQ(blend_flat(1.0, n).slope, 0.0);
  }
}

TEST(Blend, RejectsParametersWithoutABlend) {
  EXPECT_THROW(blend_flat(0.5, -1.0), InvalidInput);
  EXPECT_THROW(blend_rational(0.5, std::nan("")), InvalidInput);
}

TEST(Blend, DerivativesByNAreDifferences) {
  const double h = 1e-6;
  for (const BlendForm form : {BlendForm::rational, BlendForm::flat}) {
    for (const double n : n_values) {
      for (double v = 0.0; v <= 1.0; v += 0.125) {
        const Blend b = blend(form, v, n), up = blend(form, v, n + h), down = blend(form, v, n - h);
        EXPECT_NEAR(b.value_dn, (up.value - down.value) / (2 * h), 1e-6);
        EXPECT_NEAR(b.slope_dn, (up.slope - down.slope) / (2 * h),
                    1e-5 * (1 + std::abs(b.slope_dn)));
      }
    }
  }
}

TEST(Blend, EndConditionsFailOutsideTheRangeOfN) {
  // Why n <= -1 is refused: at -1 the functions never leave 0, below they have a pole inside.
  const auto rational = [](double v, double n) { return (1 + n) * v / (1 + n * v); };
  const auto flat = [](double v, double n) {
    return (1 + n) * v * v / ((1 + n) * v * v + (1 - v) * (1 - v));
  };
  EXPECT_EQ(rational(1 - 1e-9, -1.0), 0.0);
  EXPECT_EQ(flat(1 - 1e-9, -1.0), 0.0);
  EXPECT_GT(std::abs(rational(0.5 + 1e-9, -2.0)), 1e6);
  EXPECT_GT(std::abs(flat(0.5 + 1e-9, -2.0)), 1e6);
  for (const BlendForm form : {BlendForm::rational, BlendForm::flat}) {
    EXPECT_THROW(blend(form, 0.5, -1.0), InvalidInput);
    EXPECT_THROW(blend(form, 0.5, -2.0), InvalidInput);
    EXPECT_THROW(blend(form, 0.5, INFINITY), InvalidInput);
  }
}

TEST(Scaling, MeetsItsConditions) {
  const double slope = 1.7, alpha = 0.3, beta = -0.4;
  const auto s = [&](double v) { return scaling_through(v, slope, alpha, beta); };
  EXPECT_NEAR(s(0.0).value, 0.0, 1e-15);
  EXPECT_NEAR(s(1.0).value, 0.0, 1e-15);
  EXPECT_NEAR(s(alpha).value, beta, 1e-14);
  EXPECT_NEAR(s(0.0).slope, slope, 1e-14);
  expect_slope_is_difference(s);
  expect_slope_is_difference([&](double v) { return scaling_parabola(v, slope); });
  // A cubic through the parabola's own point is the parabola.
  for (double v = 0.0; v <= 1.0; v += 0.1) {
    EXPECT_NEAR(scaling_through(v, slope, alpha, slope * alpha * (1.0 - alpha)).value,
                scaling_parabola(v, slope).value, 1e-14);
  }
  EXPECT_THROW(scaling_through(0.5, 1.0, 1.0, 0.1), InvalidInput);
}

TEST(HomotopyPath, HasItsEndsAndEndSlopes) {
  for (const double n : n_values) {
    for (const double height : {0.2, 1.0, 1.6}) {
      const HomotopyPath path{2.0, -1.0, 0.7, -3.0, n, {0.4, height}, {0.6, height}};
      EXPECT_NEAR(path.at(0.0).value, 2.0, 1e-14);
      EXPECT_NEAR(path.at(1.0).value, -1.0, 1e-14);
      EXPECT_NEAR(path.at(0.0).slope, 0.7, 1e-13);
      EXPECT_NEAR(path.at(1.0).slope, -3.0, 1e-13);
      expect_slope_is_difference([&](double v) { return path.at(v); });
    }
  }
}

TEST(HomotopyPath, IsTheReportsRadialAndOffsetForm) {
  // r = (1-R)(1+S1) r1 + R (1+S2) r2 with S_i' = slope_i / r_i, and the same shifted by A.
  const double n = 1.3, r1 = 2.0, r2 = 5.0, s1 = 0.8, s2 = -1.1, offset = 12.5;
  for (double v = 0.0; v <= 1.0; v += 0.05) {
    const double blend = blend_flat(v, n).value, bow = v * (1.0 - v);
    const double r =
        (1.0 - blend) * (1.0 + s1 / r1 * bow) * r1 + blend * (1.0 - s2 / r2 * bow) * r2;
    EXPECT_NEAR((HomotopyPath{r1, r2, s1, s2, n}.at(v).value), r, 1e-13);
    const double w2 = 3.0;
    const double w = (1.0 - blend) * (1.0 + s1 / offset * bow) * offset +
                     blend * (1.0 - s2 / (w2 + offset) * bow) * (w2 + offset) - offset;
    EXPECT_NEAR((HomotopyPath{0.0, w2, s1, s2, n}.at(v).value), w, 1e-13);
  }
}

TEST(HomotopyPath, ReproducesAStraightLine) {
  const HomotopyPath line{1.0, 4.0, 3.0, 3.0};
  for (double v = 0.0; v <= 1.0; v += 0.1) EXPECT_NEAR(line.at(v).value, 1.0 + 3.0 * v, 1e-14);
}

TEST(HomotopyWeights, SumUpToThePath) {
  for (const double n : n_values) {
    const HomotopyPath path{0.4, 1.9, -0.6, 2.2, n};
    for (double v = 0.0; v <= 1.0; v += 0.125) {
      const HomotopyWeights w = homotopy_weights(v, n);
      EXPECT_NEAR(0.4 + 1.5 * w.change.value - 0.6 * w.start.value + 2.2 * w.end.value,
                  path.at(v).value, 1e-14);
      EXPECT_NEAR(1.5 * w.change.slope - 0.6 * w.start.slope + 2.2 * w.end.slope, path.at(v).slope,
                  1e-13);
    }
  }
}

}  // namespace
}  // namespace semblance
