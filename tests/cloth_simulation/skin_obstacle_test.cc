// Bodies from skinned, animated glTF files.
#include <gmock/gmock.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "crossing_counter.h"
#include "gltf_maker.h"
#include "plausible_fabric.h"
#include "semblance/cloth/fabric_io.h"
#include "semblance/cloth/scene_io.h"
#include "semblance/core/errors.h"
#include "semblance/io/gltf_skin.h"
#include "support.h"

namespace semblance::testing {
namespace {

using Eigen::Vector3d;
using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

class SkinObstacle : public ::testing::Test {
 protected:
  SkinObstacle() {
    write_fabric(path("cotton.json"), plausible_fabric());
    GltfMaker maker = bending_bar(1.2);
    maker.json["animations"].push_back({{"name", "grow"}});
    const int times = maker.add(std::vector<float>{0.0f, 0.25f}, "SCALAR");
    maker.add_channel(1, "scale", times, maker.add(std::vector<float>{1, 1, 1, 1, 3, 1}, "VEC3"));
    maker.write_binary(path("bar.glb"));
  }

  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }
  SimulationSetup read(const json& body) const {
    const json scene = {{"schema", "semblance.cloth_scene/1"},
                        {"fabric", "cotton.json"},
                        {"sheet",
                         {{"kind", "rectangle"},
                          {"warp_m", 0.4},
                          {"weft_m", 0.4},
                          {"spacing_m", 0.04},
                          {"placement", {{"translation_m", {0.25, 0.06, 0.0}}}}}},
                        {"obstacles", {body}}};
    std::ofstream(path("scene.json")) << scene;
    return read_cloth_scene(path("scene.json"));
  }
  Obstacle obstacle(json body) const {
    body["kind"] = "skinned_mesh";
    if (!body.contains("file")) body["file"] = "bar.glb";
    return read(body).make(0.1).obstacles.at(0);
  }

 private:
  TemporaryFolder folder_;
};

/// The bar's corner on top, bent by that much.
Vector3d tip(double turn_rad) { return bent_bar_vertex(bar_rings - 1, 0, turn_rad); }

Vector3d tip_of(const Obstacle& body, double time_s) {
  return obstacle_mesh(body, time_s).positions_m.row(4 * (bar_rings - 1));
}

TEST_F(SkinObstacle, GoesStraightBetweenSamples) {
  const Obstacle body = obstacle({{"fps", 4}});
  EXPECT_TRUE(is_moving(body));
  EXPECT_EQ(body.name, "skinned_mesh 1");
  for (const double t : {0.0, 0.25, 0.75, 1.0}) {
    EXPECT_LT((tip_of(body, t) - tip(1.2 * t)).norm(), 1e-6) << t;
  }
  EXPECT_LT((tip_of(body, 0.4) - 0.4 * tip(0.3) - 0.6 * tip(0.6)).norm(), 1e-6);
  EXPECT_LT((tip_of(body, 7.0) - tip(1.2)).norm(), 1e-6);
}

TEST_F(SkinObstacle, EndsWithTheAnimation) {
  const Obstacle body = obstacle({{"fps", 1.6}});  // samples at 0, 0.625 and 1 s
  EXPECT_LT((tip_of(body, 0.625) - tip(0.75)).norm(), 1e-6);
  EXPECT_LT((tip_of(body, 1.0) - tip(1.2)).norm(), 1e-6);
  EXPECT_LT((tip_of(body, 0.8125) - 0.5 * (tip(0.75) + tip(1.2))).norm(), 1e-6);
}

TEST_F(SkinObstacle, IsScaledThenTurnedThenMoved) {
  const Obstacle body =
      obstacle({{"scale", 0.5}, {"turn_deg", {0, 0, 90}}, {"translation_m", {1, 2, 3}}});
  const Vector3d p = tip(0.6);
  EXPECT_LT(
      (tip_of(body, 0.5) - Vector3d(1 - 0.5 * p.y(), 2 + 0.5 * p.x(), 3 + 0.5 * p.z())).norm(),
      1e-6);
}

TEST_F(SkinObstacle, PlaysTheAnimationThatIsNamed) {
  for (const json& name : {json("grow"), json(1)}) {
    EXPECT_NEAR(tip_of(obstacle({{"animation", name}}), 0.25).y(), 6.0, 1e-5);
  }
  EXPECT_LT((tip_of(obstacle({{"animation", "bend"}}), 1.0) - tip(1.2)).norm(), 1e-6);
  const Obstacle still = obstacle({{"animation", false}});
  EXPECT_FALSE(is_moving(still));
  EXPECT_LT((tip_of(still, 1.0) - tip(0.0)).norm(), 1e-6);
}

TEST_F(SkinObstacle, NamesWhatIsWrong) {
  const auto expect_refused = [&](const json& body, const std::string& message) {
    EXPECT_THAT([&] { obstacle(body); }, ThrowsMessage<InvalidInput>(HasSubstr(message)));
  };
  const std::string choices = "expected false, 0 ('bend'), 1 ('grow')";
  expect_refused({{"animation", "walk"}}, choices);
  expect_refused({{"animation", 2}}, choices);
  expect_refused({{"animation", true}}, choices);
  expect_refused({{"fps", 0}}, "fps");
  expect_refused({{"loop", true}}, "unknown key 'loop'");
  std::ofstream(path("text.glb")) << "hello";
  expect_refused({{"file", "text.glb"}}, "text.glb");
  EXPECT_THAT(
      [&] {
        obstacle({{"file", "absent.glb"}});
      },
      ThrowsMessage<IoError>(AllOf(HasSubstr("absent.glb"), HasSubstr("own folder"))));
  GltfMaker endless = bending_bar(1.0);
  endless.json["animations"][0]["samplers"][0]["input"] =
      endless.add(std::vector<float>{0.0f, 1e9f}, "SCALAR");
  endless.write_binary(path("endless.glb"));
  expect_refused({{"file", "endless.glb"}}, "more than 100 million positions");
  GltfMaker huge = bending_bar(1.0);
  huge.json["nodes"][1]["scale"] = {1e200, 1e200, 1e200};
  huge.json["nodes"][2]["scale"] = {1e200, 1e200, 1e200};
  huge.write_binary(path("huge.glb"));
  expect_refused({{"file", "huge.glb"}}, "huge.glb): its motion is not finite");
}

/// The bar lies along x under the sheet, and its far half comes up by 0.6 rad in half a second.
TEST_F(SkinObstacle, LiftsASheetThatNeverCrossesIt) {
  const SimulationSetup setup = read(
      {{"kind", "skinned_mesh"}, {"file", "bar.glb"}, {"scale", 0.25}, {"turn_deg", {0, 0, -90}}});
  SimulationOptions options;
  options.spacing_m = setup.spacing_m;
  options.until_s = 0.5;
  CrossingCounter counter(setup.make(setup.spacing_m));
  const SimulationSummary summary = simulate(setup, options, counter, silent_progress());
  EXPECT_EQ(summary.penetrations, 0);
  EXPECT_EQ(counter.crossings, 0);
  EXPECT_EQ(counter.frames, 13);
  const Points& sheet_m = summary.state.positions_m;
  EXPECT_GT(sheet_m.col(1).maxCoeff(), 0.15);  // from 0.06, by the bar alone
  EXPECT_LT(sheet_m.col(1).minCoeff(), 0.0);   // and hangs down beside it
}

}  // namespace
}  // namespace semblance::testing
