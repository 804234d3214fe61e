// What presets set up.
#include "semblance/cloth/presets.h"

#include <gmock/gmock.h>

#include "plausible_fabric.h"
#include "semblance/core/errors.h"

namespace semblance::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

TEST(Preset, AllStartClearOfTheirBodies) {
  for (const std::string& name : preset_names()) {
    const SimulationSetup setup = preset_setup(name, plausible_fabric());
    for (const double spacing_m : {setup.spacing_m, 2.0 * setup.spacing_m}) {
      ClothSystem system(setup.make(spacing_m), {.linear_solver = "jacobi"});
      EXPECT_EQ(system.contacts().start_problem(system.scene().start_m), std::nullopt) << name;
    }
  }
}

TEST(Preset, SheetsFaceUp) {
  for (const std::string& name : preset_names()) {
    const SimulationSetup setup = preset_setup(name, plausible_fabric());
    const ClothScene scene = setup.make(setup.spacing_m);
    const Eigen::Vector3d a = scene.start_m.row(scene.sheet.triangles(0, 0));
    const Eigen::Vector3d b = scene.start_m.row(scene.sheet.triangles(0, 1));
    const Eigen::Vector3d c = scene.start_m.row(scene.sheet.triangles(0, 2));
    EXPECT_GT((b - a).cross(c - a).y(), 0.0) << name;
  }
}

TEST(Preset, TheSheetLiesOffTheMiddleOfTheTable) {
  const ClothScene scene = make_preset("table", 0.02, plausible_fabric());
  const Eigen::RowVector3d middle =
      0.5 * (scene.start_m.colwise().minCoeff() + scene.start_m.colwise().maxCoeff());
  EXPECT_NEAR(middle.x(), 0.05, 1e-12);
  EXPECT_NEAR(middle.z(), 0.04, 1e-12);
  EXPECT_NEAR(middle.y(), 0.8 * plausible_fabric().thickness_m, 1e-15);
  EXPECT_EQ(scene.sheet.grid->columns, 51);
}

TEST(Preset, PinnedHasAHundredByAHundredParticles) {
  const SimulationSetup setup = preset_setup("pinned", plausible_fabric());
  const ClothScene scene = setup.make(setup.spacing_m);
  EXPECT_EQ(scene.sheet.vertex_count(), 10000);
  EXPECT_EQ(scene.fixed.size(), 2u);
}

TEST(Preset, TheStripHasItsFreeLengthBeyondTheClamp) {
  for (const double spacing_m : {0.01, 0.007, 0.0025}) {
    const ClothScene scene = make_preset("strip", spacing_m, plausible_fabric());
    double clamp_m = -1.0;
    for (const int v : scene.fixed) clamp_m = std::max(clamp_m, scene.start_m(v, 0));
    EXPECT_NEAR(clamp_m, 0.0, 1e-12);
    EXPECT_NEAR(scene.start_m.col(0).maxCoeff(), 0.2, 1e-12);
  }
}

/// A start has the same dents on any mesh, another one has others, and the clamp is flat.
TEST(Preset, DiscsStartWithDentsOfTheirOwn) {
  const ClothScene coarse = make_preset("disc", 0.01, plausible_fabric(), 3);
  const ClothScene fine = make_preset("disc", 0.005, plausible_fabric(), 3);
  const ClothScene other = make_preset("disc", 0.01, plausible_fabric(), 4);
  const double flat_m = 0.8 * plausible_fabric().thickness_m;
  double largest_m = 0.0;
  int met = 0;
  for (Eigen::Index v = 0; v < coarse.start_m.rows(); ++v) {
    if (coarse.sheet.material_m.row(v).norm() < 0.09 + 1e-9) {
      EXPECT_NEAR(coarse.start_m(v, 1), flat_m, 1e-12);
    }
    largest_m = std::max(largest_m, std::abs(coarse.start_m(v, 1) - other.start_m(v, 1)));
    for (Eigen::Index w = 0; w < fine.start_m.rows(); ++w) {
      if ((fine.sheet.material_m.row(w) - coarse.sheet.material_m.row(v)).norm() > 1e-9) continue;
      EXPECT_NEAR(fine.start_m(w, 1), coarse.start_m(v, 1), 1e-9);
      ++met;
    }
  }
  EXPECT_GT(met, coarse.start_m.rows() / 2);
  EXPECT_GT(largest_m, 5e-4);
  EXPECT_LT(largest_m, 1e-2);
}

TEST(Preset, RefusesUnknownNamesAndSpacingsThatDoNotFit) {
  const auto make = [](const std::string& name, double spacing_m) {
    return [=] { make_preset(name, spacing_m, plausible_fabric()); };
  };
  EXPECT_THAT(make("curtain", 0.01),
              ThrowsMessage<InvalidInput>(HasSubstr("table, pinned, pinned-box, disc, strip")));
  EXPECT_THAT(make("table", 0.5), ThrowsMessage<InvalidInput>(HasSubstr("table: sheet: weft")));
  EXPECT_THAT(make("strip", 0.05), ThrowsMessage<InvalidInput>(HasSubstr("strip")));
  EXPECT_THAT(make("disc", -1.0), ThrowsMessage<InvalidInput>(HasSubstr("positive")));
  EXPECT_THAT([] { make_sheet_model("rubber", true); },
              ThrowsMessage<InvalidInput>(HasSubstr("choi-ko")));
}

}  // namespace
}  // namespace semblance::testing
