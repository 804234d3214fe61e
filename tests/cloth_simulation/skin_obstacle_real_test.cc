// Cloth on a body that somebody else made and animated.
#include <gmock/gmock.h>

#include "crossing_counter.h"
#include "plausible_fabric.h"
#include "semblance/cloth/presets.h"
#include "semblance/io/gltf_skin.h"
#include "support.h"

namespace semblance::testing {
namespace {

/// Half a second of his walk under a sheet that starts above his head.
TEST(SkinObstacleFiles, AManWalksUnderASheet) {
  SEMBLANCE_NEED_DATA("body/gltf/CesiumMan.glb");
  const SkinnedMesh man = read_gltf_skin(data_path("body/gltf/CesiumMan.glb").string());
  const Obstacle body = make_skin_obstacle("man", man, man.animations.data());
  SimulationSetup setup;
  setup.make = [&](double spacing_m) {
    ClothScene scene;
    scene.sheet = make_rectangle(0.4, 0.4, spacing_m);
    scene.start_m = lay_flat(scene.sheet, {-0.1, 1.49, 0.2});
    scene.fabric = plausible_fabric();
    scene.obstacles = {body};
    return scene;
  };
  SimulationOptions options;
  options.spacing_m = 0.04;
  options.until_s = 0.5;
  CrossingCounter counter(setup.make(options.spacing_m));
  const SimulationSummary summary = simulate(setup, options, counter, silent_progress());
  EXPECT_EQ(summary.penetrations, 0);
  EXPECT_EQ(counter.crossings, 0);
  EXPECT_EQ(counter.frames, 13);
  // It slides down his head, which is 1.50 m up by then, and without him would be below 0.5 m.
  EXPECT_GT(summary.state.positions_m.col(1).maxCoeff(), 1.42);
  EXPECT_LT(summary.state.positions_m.col(1).minCoeff(), 1.33);
}

}  // namespace
}  // namespace semblance::testing
