#include "semblance/cloth/kes.h"

#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <numbers>

#include "semblance/cloth/fabric_io.h"
#include "semblance/cloth/kes_loops.h"
#include "semblance/core/errors.h"
#include "support.h"

namespace semblance {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;

// The factors that the data's manifest lists, to the digits it gives.
TEST(KesUnits, AgreeWithTheManifest) {
  EXPECT_NEAR(kes::n_m_from_gf_cm2_cm, 9.807e-5, 5e-9);
  EXPECT_NEAR(kes::n_from_gf_cm_cm, 9.807e-3, 5e-7);
  EXPECT_NEAR(kes::n_m_rad_from_gf_cm_deg, 56.19, 5e-3);
  EXPECT_NEAR(kes::n_m_from_gf_cm, 0.981, 5e-4);
  EXPECT_NEAR(kes::j_m2_from_gf_cm_cm2, 0.981, 5e-4);
}

/// The elasto-plastic slider, written apart from the library's: elastic force and threshold are
/// functions, the slider's spring drags its anchor behind it.
Specimen slider(std::function<double(double)> elastic, std::function<double(double)> threshold,
                double reach) {
  double anchor = 0.0;
  return [=](double e) mutable {
    if (e - anchor > reach) anchor = e - reach;
    if (anchor - e > reach) anchor = e + reach;
    return elastic(e) + threshold(std::abs(e)) * (e - anchor) / reach;
  };
}

Specimen slider_of(const ModeResponse& mode) {
  const Curve elastic = mode.elastic, friction = mode.friction;
  const auto odd = [elastic](double e) { return e < 0.0 ? -elastic.value(-e) : elastic.value(e); };
  return slider(
      odd, [friction](double e) { return friction.value(e); }, mode.reversal);
}

Specimens sliders_of(const Fabric& fabric) {
  return {{slider_of(fabric.tension[warp]), slider_of(fabric.tension[weft])},
          {slider_of(fabric.bending[warp]), slider_of(fabric.bending[weft])},
          slider_of(fabric.shear)};
}

TEST(FiguresOf, ASliderWithStraightElasticity) {
  constexpr double deg = kes::rad_from_deg;
  // G 1.5 of which friction makes 0.2 per degree; 2HG 1.0 and with 0.2 per degree 2HG5 2.8.
  KesLoops loops;
  loops.shear =
      run_shear_test(slider([](double e) { return 1.3 * 0.980665 * e / deg; },
                            [](double e) { return (0.4 + 0.2 * e / deg) * 0.980665; }, 0.05 * deg));
  loops.bending[warp] =
      run_bending_test(slider([](double k) { return 2e-5 * k; }, [](double) { return 3e-4; }, 3.0));
  const KesFigures figures = figures_of(loops);
  EXPECT_NEAR(*figures.shear.g_gf_cm_deg, 1.5, 1e-9);
  EXPECT_NEAR(*figures.shear.hg2_gf_cm, 1.0, 1e-9);
  EXPECT_NEAR(*figures.shear.hg5_gf_cm, 2.8, 1e-9);
  EXPECT_NEAR(*figures.bending[warp].b_gf_cm2_cm, 2e-5 / 9.80665e-5, 1e-9);
  EXPECT_NEAR(*figures.bending[warp].hb2_gf_cm_cm, 6e-4 / 9.80665e-3, 1e-9);
  EXPECT_FALSE(figures.bending[weft].b_gf_cm2_cm);
  EXPECT_FALSE(figures.tension[warp].emt_pct);
}

TEST(FiguresOf, ASpringInTension) {
  KesLoops loops;
  loops.tension[warp] = run_tension_test([](double e) { return 8000.0 * e; });
  // The force grows with the square: EMT is where it reaches 490.3 N/m, LT is 2/3.
  loops.tension[weft] = run_tension_test([](double e) { return 2e5 * e * std::abs(e); });
  const KesFigures figures = figures_of(loops);
  EXPECT_NEAR(*figures.tension[warp].emt_pct, 100.0 * 490.3325 / 8000.0, 1e-6);
  EXPECT_NEAR(*figures.tension[warp].lt, 1.0, 1e-6);
  EXPECT_NEAR(*figures.tension[warp].rt_pct, 100.0, 1e-6);
  const double strain = std::sqrt(490.3325 / 2e5);
  EXPECT_NEAR(*figures.tension[weft].emt_pct, 100.0 * strain, 1e-3);
  EXPECT_NEAR(*figures.tension[weft].lt, 2.0 / 3.0, 1e-4);
  const double work = 2e5 * strain * strain * strain / 3.0;
  EXPECT_NEAR(*figures.tension[weft].wt_gf_cm_cm2 / (work / 0.980665), 1.0, 1e-4);
}

TEST(FiguresOf, ResilienceOfAClothThatStaysLonger) {
  // Loading 1e4 e; unloading 2e4 (e - EMT / 2): half of the work is given back.
  const double end = 490.3325 / 1e4;
  double longest = 0.0;
  KesLoops loops;
  loops.tension[warp] = run_tension_test([&](double e) {
    longest = std::max(longest, e);
    return e < longest ? std::max(0.0, 2e4 * (e - 0.5 * end)) : 1e4 * e;
  });
  EXPECT_NEAR(*figures_of(loops).tension[warp].rt_pct, 50.0, 0.05);
}

TEST(FiguresOf, LeavesOutWhatWasNotReached) {
  KesLoops loops;
  loops.shear = {{0.0, 0.0}, {0.05, 1.0}, {0.0, -0.1}};  // to 2.9 deg only
  const KesFigures figures = figures_of(loops);
  EXPECT_TRUE(figures.shear.g_gf_cm_deg);
  EXPECT_TRUE(figures.shear.hg2_gf_cm);
  EXPECT_FALSE(figures.shear.hg5_gf_cm);
}

TEST(TensionTest, SaysWhenTheSpecimenGivesWay) {
  EXPECT_THROW(run_tension_test([](double e) { return 10.0 * e; }), SolverError);
  EXPECT_THROW(run_tension_test([](double) { return 0.0; }), SolverError);
  EXPECT_THROW(run_tension_test([](double) { return std::nan(""); }), SolverError);
}

TEST(MaterialPoint, IsTheSliderOfTheTest) {
  KesFigures figures;
  figures.shear = {2.0, 4.0, 7.0};
  const Fabric fabric = fabric_from_figures(figures, "test");
  const Specimen ours = material_point(fabric.shear), other = slider_of(fabric.shear);
  for (double t = 0.0; t < 60.0; t += 0.01) {
    const double angle = 0.14 * std::sin(t) * std::cos(0.13 * t);
    EXPECT_NEAR(ours(angle), other(angle), 1e-9);
  }
}

class NineFabrics : public ::testing::TestWithParam<const char*> {};

// One test per fabric, with the slider written above and not with the library's own.
TEST_P(NineFabrics, GivenFiguresComeBack) {
  SEMBLANCE_NEED_DATA("cloth/kes_fabrics.csv");
  const FabricRecord record =
      read_fabric_record(testing::data_path("cloth/kes_fabrics.csv").string(), GetParam());
  const KesFigures reproduced = figures_of(run_kes_tests(sliders_of(record.fabric)));
  int count = 0;
  for (const FigureComparison& comparison : compare_figures(record.given, reproduced)) {
    if (!comparison.given) continue;
    ++count;
    // LT and WT of denim C contradict each other by 2 %: each is missed by half of that.
    EXPECT_NEAR(*comparison.residual_pct(), 0.0, record.fabric.name == "denim C" ? 1.01 : 0.1)
        << comparison.name.symbol << ' ' << comparison.name.direction;
  }
  EXPECT_EQ(count, std::string(GetParam()).starts_with("denim") ? 15 : 4);
}

INSTANTIATE_TEST_SUITE_P(Kes, NineFabrics,
                         ::testing::Values("denim A", "denim B", "denim C", "denim D", "denim E",
                                           "denim F", "cotton broad", "wool tropical",
                                           "polyester faille"));

TEST(FabricFromFigures, ReproducesUnusualFigures) {
  for (const double lt : {0.2, 0.5, 0.95, 1.1}) {
    for (const double rt_pct : {20.0, 60.0, 100.0}) {
      KesFigures figures;
      figures.tension[warp] = {12.0, lt, std::nullopt, rt_pct};
      figures.shear = {0.3, 0.1, 1.5};
      figures.bending[weft] = {0.02, 0.0};
      const Fabric fabric = fabric_from_figures(figures, "test");
      const KesFigures back = figures_of(run_kes_tests(sliders_of(fabric)));
      EXPECT_NEAR(*back.tension[weft].emt_pct, 12.0, 0.05);
      EXPECT_NEAR(*back.tension[warp].lt / lt, 1.0, 0.01) << lt << ' ' << rt_pct;
      EXPECT_NEAR(*back.tension[warp].rt_pct / rt_pct, 1.0, 0.01) << lt << ' ' << rt_pct;
      EXPECT_NEAR(*back.shear.g_gf_cm_deg, 0.3, 1e-6);
      EXPECT_NEAR(*back.shear.hg2_gf_cm, 0.1, 1e-6);
      EXPECT_NEAR(*back.shear.hg5_gf_cm, 1.5, 1e-6);
      EXPECT_NEAR(*back.bending[warp].b_gf_cm2_cm, 0.02, 1e-9);
      EXPECT_NEAR(*back.bending[warp].hb2_gf_cm_cm, 0.0, 1e-9);
    }
  }
}

TEST(FabricFromFigures, TwoOfStrainLinearityAndWorkGiveTheThird) {
  KesFigures figures;
  figures.tension = {{{5.0, 0.7, std::nullopt, 60.0}, {5.0, std::nullopt, 8.75, 60.0}}};
  const Fabric fabric = fabric_from_figures(figures, "test");
  EXPECT_NEAR(fabric.tension[warp].elastic.value(0.03), fabric.tension[weft].elastic.value(0.03),
              1e-6);
  figures.tension[weft] = {std::nullopt, 0.7, 8.75, 60.0};
  EXPECT_NEAR(fabric_from_figures(figures, "test").tension[weft].elastic.last(), 0.05, 1e-9);
}

TEST(FabricFromFigures, SaysWhatItAssumed) {
  KesFigures figures;
  figures.bending[warp].b_gf_cm2_cm = 0.05;
  const Fabric fabric = fabric_from_figures(figures, "test");
  for (const char* what : {"bending along weft", "EMT", "LT", "RT", "G in", "2HG in", "2HG5", "2HB",
                           "area density", "thickness", "friction", "damping", "viscosity"}) {
    EXPECT_THAT(fabric.assumptions, Contains(HasSubstr(what)));
  }
  EXPECT_EQ(fabric.bending[warp], fabric.bending[weft]);
  EXPECT_NO_THROW(validate(fabric_from_figures({}, "test"), "test"));
}

TEST(FabricFromFigures, RefusesImpossibleFigures) {
  const auto problem = [](const KesFigures& figures) -> std::string {
    try {
      fabric_from_figures(figures, "a.csv:3: x");
    } catch (const InvalidInput& error) {
      return error.what();
    }
    return "nothing";
  };
  KesFigures figures;
  figures.tension[warp] = {5.0, 0.7, 19.0, 60.0};
  EXPECT_THAT(problem(figures), AllOf(HasSubstr("a.csv:3: x"), HasSubstr("misprinted")));
  figures = {};
  figures.tension[warp] = {5.0, std::nullopt, 30.0, 60.0};
  EXPECT_THAT(problem(figures), HasSubstr("make LT 2.4"));
  figures = {};
  figures.shear = {0.5, 1.0, 8.0};
  EXPECT_THAT(problem(figures), HasSubstr("2HG5 is too large"));
  figures = {};
  figures.shear.g_gf_cm_deg = -1.0;
  figures.bending[weft].b_gf_cm2_cm = 9e-6;
  EXPECT_THAT(problem(figures),
              AllOf(HasSubstr("G is -1"), HasSubstr("B weft is 9e-06"), HasSubstr("KES units?")));
  figures = {};
  figures.weight_g_m2 = 0.2;
  EXPECT_THAT(problem(figures), HasSubstr("area density"));
}

}  // namespace
}  // namespace semblance
