#include "semblance/cloth/fabric.h"

#include <gmock/gmock.h>

#include <cmath>
#include <functional>

#include "plausible_fabric.h"
#include "semblance/cloth/kes_loops.h"
#include "semblance/core/errors.h"

namespace semblance {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::plausible_fabric;

std::string problem_with(const std::function<void(Fabric&)>& change) {
  Fabric fabric = plausible_fabric();
  change(fabric);
  try {
    validate(fabric, "a.json");
  } catch (const InvalidInput& error) {
    return error.what();
  }
  return "nothing";
}

TEST(FabricValidation, AcceptsAPlausibleFabric) {
  EXPECT_EQ(problem_with([](Fabric&) {}), "nothing");
}

TEST(FabricValidation, NamesTheUnitThatWasMeant) {
  const auto refused = [](const std::function<void(Fabric&)>& change, const std::string& what,
                          const std::string& remedy) {
    EXPECT_THAT(problem_with(change), AllOf(HasSubstr("a.json: " + what), HasSubstr(remedy)));
  };
  refused([](Fabric& f) { f.area_density_kg_m2 = 120.0; }, "area density", "g/m2?");
  refused([](Fabric& f) { f.area_density_kg_m2 = -0.1; }, "area density", "-0.1");
  refused([](Fabric& f) { f.area_density_kg_m2 = std::nan(""); }, "area density", "nan");
  refused([](Fabric& f) { f.thickness_m = 0.3; }, "thickness", "mm?");
  refused([](Fabric& f) { f.friction = -0.3; }, "friction", "-0.3");
  refused([](Fabric& f) { f.mass_damping_1_s = -1.0; }, "mass damping", "-1");
  refused([](Fabric& f) { f.tension[warp] = linear_response(9e6, 0.05); }, "tension along warp",
          "N/m");
  refused([](Fabric& f) { f.tension[weft] = linear_response(90.0, 5.0); }, "tension along weft",
          "did you mean %?");
  refused([](Fabric& f) { f.shear = linear_response(1.0, 0.14); }, "shear", "gf/(cm deg)");
  refused([](Fabric& f) { f.shear = linear_response(60.0, 8.0); }, "shear", "did you mean deg?");
  refused([](Fabric& f) { f.bending[warp] = linear_response(0.1, 250.0); }, "bending along warp",
          "gf cm2/cm");
  refused([](Fabric& f) { f.bending[weft] = linear_response(1e-5, 2.5); }, "bending along weft",
          "did you mean 1/cm?");
  refused([](Fabric& f) { f.shear.viscosity_s = 5.0; }, "shear viscosity_s", "ms?");
}

TEST(FabricValidation, RefusesCurvesThatCannotBe) {
  EXPECT_THAT(problem_with([](Fabric& f) {
                f.shear.elastic = Curve({0.0, 0.05, 0.1, 0.14}, {0.0, 4.0, 3.0, 8.0});
              }),
              HasSubstr("shear: the elastic curve does not rise between 0.05 and 0.1"));
  EXPECT_THAT(problem_with([](Fabric& f) {
                f.shear.elastic = Curve({0.0, 0.14}, {1.0, 8.0});
              }),
              HasSubstr("must begin at (0, 0)"));
  EXPECT_THAT(problem_with([](Fabric& f) { f.shear.friction = Curve::constant(-1.0, 0.14); }),
              HasSubstr("cannot be negative"));
  EXPECT_THAT(problem_with([](Fabric& f) { f.shear.friction = Curve::constant(1e3, 0.14); }),
              HasSubstr("same unit"));
  EXPECT_THAT(problem_with([](Fabric& f) { f.shear.reversal = 0.0; }), HasSubstr("reversal"));
}

TEST(FabricValidation, ListsAllProblemsAtOnce) {
  EXPECT_THAT(problem_with([](Fabric& f) {
                f.area_density_kg_m2 = 120.0;
                f.thickness_m = 0.3;
              }),
              AllOf(HasSubstr("g/m2?"), HasSubstr("mm?")));
}

TEST(FabricValidation, RefusesABiasThatIsTooWeak) {
  EXPECT_THAT(problem_with([](Fabric& f) { f.bending_bias = linear_response(0.4e-5, 250.0); }),
              HasSubstr("too weak to be possible"));
  // (1.2 + 0.8) / 4 = 0.5: so much is needed where twisting is free.
  EXPECT_EQ(problem_with([](Fabric& f) { f.bending_bias = linear_response(0.51e-5, 250.0); }),
            "nothing");
}

TEST(TwistResponse, IsotropicPlateWithoutPoissonsRatioTwistsWithTwiceItsRigidity) {
  Fabric fabric = plausible_fabric();
  constexpr double rigidity = 1e-5;
  fabric.bending = {linear_response(rigidity, 250.0), linear_response(rigidity, 250.0)};
  const ModeResponse assumed = twist_response(fabric);
  fabric.bending_bias = linear_response(rigidity, 250.0);
  const ModeResponse measured = twist_response(fabric);
  for (const double k : {1.0, 60.0, 125.0, 300.0}) {
    EXPECT_NEAR(assumed.elastic.value(k), 2.0 * rigidity * k, 1e-9 * rigidity * k);
    EXPECT_NEAR(measured.elastic.value(k), 2.0 * rigidity * k, 1e-9 * rigidity * k);
  }
}

TEST(TwistResponse, GivesBackTheBiasItWasMadeFrom) {
  Fabric fabric = plausible_fabric();
  const Curve bent({0.0, 50.0, 100.0, 250.0}, {0.0, 1e-3, 1.6e-3, 2.6e-3});
  fabric.bending_bias = ModeResponse{bent, Curve::constant(5e-4, 250.0), 5.0, 1e-3};
  const ModeResponse twist = twist_response(fabric);
  for (const double k : bent.x()) {
    const double h = 0.5 * k;
    const double elastic = fabric.bending[warp].elastic.value(h) +
                           fabric.bending[weft].elastic.value(h) + twist.elastic.value(h);
    EXPECT_NEAR(0.5 * elastic, bent.value(k), 1e-15);
    const double friction = fabric.bending[warp].friction.value(h) +
                            fabric.bending[weft].friction.value(h) + twist.friction.value(h);
    EXPECT_NEAR(0.5 * friction, 5e-4, 1e-15);
  }
}

TEST(TwistResponse, WithoutAMeasuredBiasItsLoopIsTheMeanOfWarpAndWeft) {
  const Fabric fabric = plausible_fabric();
  const ModeResponse twist = twist_response(fabric);
  EXPECT_NEAR(twist.elastic.value(100.0), 2.0e-5 * 100.0, 1e-15);
  EXPECT_EQ(twist.friction.largest_value(), 0.0);
}

// Loading and unloading of a slider with elastic force 10 e and friction 1, turned over 0.04.
Curve slider_branch(bool loading, double reversal) {
  std::vector<double> x, force;
  for (int i = 0; i <= 100; ++i) {
    const double e = 0.02 * i;
    const double q =
        loading ? std::min(1.0, e / reversal) : std::max(-1.0, 1.0 - (2.0 - e) / reversal);
    x.push_back(e);
    force.push_back(10.0 * e + q);
  }
  return {x, force};
}

TEST(ResponseFromLoop, FindsElasticForceAndFrictionBehindTheTurns) {
  const ModeResponse response = response_from_loop(
      slider_branch(true, 0.04), slider_branch(false, 0.04), Turns::sliding, 0.0, "loop");
  EXPECT_DOUBLE_EQ(response.reversal, 0.04);
  for (double e = 0.0; e <= 2.5; e += 0.05) {
    EXPECT_NEAR(response.elastic.value(e), 10.0 * e, 1e-9);
    EXPECT_NEAR(response.friction.value(e), 1.0, 1e-9);
  }
}

// Gone through again with the slider under way, both branches come back.
TEST(ResponseFromLoop, ALoopThatClosesStaysClosed) {
  std::vector<double> x, up, down;
  for (int i = 0; i <= 50; ++i) {
    const double t = 0.02 * i;
    x.push_back(t);
    up.push_back(t);
    down.push_back(t - 0.4 * t * (1.0 - t));
  }
  const ModeResponse response = response_from_loop({x, up}, {x, down}, Turns::closing, 0.0, "loop");
  const Specimen specimen = material_point(response);
  for (int i = 0; i <= 1000; ++i) EXPECT_NEAR(specimen(1e-3 * i), 1e-3 * i, 3e-4) << i;
  for (int i = 1000; i >= 0; --i) {
    const double t = 1e-3 * i;
    EXPECT_NEAR(specimen(t), t - 0.4 * t * (1.0 - t), 1e-3) << t;
  }
  EXPECT_NEAR(response.friction.value(0.5), 0.05, 1e-6);
}

/// The slider sticks up to 0.1, then slips.
TEST(LoadingCurve, IsElasticForceAndFrictionFromRest) {
  ModeResponse mode = linear_response(10.0, 1.0, 2.0);
  mode.reversal = 0.1;
  const Curve loading = loading_curve(mode);
  for (const double e : {0.0, 0.05, 0.1, 0.2, 0.5, 1.0, 1.5}) {
    EXPECT_NEAR(loading.value(e), 10.0 * e + std::min(20.0 * e, 2.0), 1e-9) << e;
  }
  EXPECT_EQ(loading_curve(linear_response(10.0, 1.0)), linear_response(10.0, 1.0).elastic);
}

// Digitised plots have few points: none of them may lie where the slider is under way.
TEST(ResponseFromLoop, AFewPointsBehindTheTurnsAreEnough) {
  const Curve up({0.0, 1.0, 2.0}, {0.0, 11.0, 21.0}), down({0.0, 1.0, 2.0}, {-1.0, 9.0, 21.0});
  const ModeResponse response = response_from_loop(up, down, Turns::sliding, 0.0, "loop");
  for (const double e : {0.0, 0.5, 1.3, 2.0}) {
    EXPECT_NEAR(response.elastic.value(e), 10.0 * e, 1e-9);
    EXPECT_NEAR(response.friction.value(e), 1.0, 1e-9);
  }
  const Curve line = Curve::linear(1.0, 1.0);
  EXPECT_THROW(response_from_loop(line, line, Turns::sliding, 0.0, "loop"), InvalidInput);
}

TEST(ResponseFromLoop, RefusesWhatIsNoLoop) {
  const auto problem = [](const Curve& up, const Curve& down) -> std::string {
    try {
      response_from_loop(up, down, Turns::closing, 0.0, "x.csv: shear");
    } catch (const InvalidInput& error) {
      return error.what();
    }
    return "nothing";
  };
  const Curve line = Curve::linear(1.0, 1.0);
  EXPECT_EQ(problem(line, line), "nothing");
  EXPECT_THAT(problem(line, Curve::linear(1.0, 0.8)), HasSubstr("x.csv: shear: loading ends at 1"));
  EXPECT_THAT(problem(line, Curve({0.0, 0.5, 1.0}, {0.0, 0.6, 1.0})), HasSubstr("exchanged?"));
  const Curve bump({0.0, 0.5, 0.7, 1.0}, {0.0, 0.9, 0.8, 1.0});
  EXPECT_THAT(problem(bump, bump), HasSubstr("does not rise between 0.5 and 0.7"));
}

TEST(CompleteFabric, SaysWhatItAssumed) {
  Fabric fabric;
  fabric.thickness_m = 1e-3;
  complete_fabric(fabric, std::nullopt, 0.2);
  EXPECT_DOUBLE_EQ(fabric.area_density_kg_m2, 0.35);
  EXPECT_EQ(fabric.friction, assumed::friction);
  EXPECT_EQ(fabric.mass_damping_1_s, 0.2);
  EXPECT_THAT(fabric.assumptions,
              ::testing::ElementsAre(HasSubstr("350 g/m2"), HasSubstr("friction")));
}

}  // namespace
}  // namespace semblance
