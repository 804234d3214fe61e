// Scene files: the documented example, every kind of part, and what is refused.
#include "semblance/cloth/scene_io.h"

#include <gmock/gmock.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "plausible_fabric.h"
#include "semblance/cloth/fabric_io.h"
#include "semblance/cloth/presets.h"
#include "semblance/core/errors.h"
#include "semblance/io/mesh_io.h"
#include "support.h"

namespace semblance::testing {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

class SceneFile : public ::testing::Test {
 protected:
  SceneFile() { write_fabric(path("cotton.json"), plausible_fabric()); }

  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }
  SimulationSetup read(const json& scene) const {
    std::ofstream(path("scene.json")) << scene.dump(2);
    return read_cloth_scene(path("scene.json"));
  }
  void expect_refused(const json& scene, const std::string& message) const {
    EXPECT_THAT([&] { read(scene).make(0.1); }, ThrowsMessage<InvalidInput>(HasSubstr(message)));
  }
  void write_tetrahedron(const std::string& name, double height_m) const {
    Mesh mesh;
    mesh.positions_m.resize(4, 3);
    mesh.positions_m << 0.0, height_m, 0.0, 1.0, -1.0, 0.0, -1.0, -1.0, 1.0, -1.0, -1.0, -1.0;
    mesh.triangles.resize(4, 3);
    mesh.triangles << 0, 2, 1, 0, 3, 2, 0, 1, 3, 1, 2, 3;
    write_mesh(path(name), mesh);
  }

  const json sheet = {{"kind", "rectangle"}, {"warp_m", 1.0}, {"weft_m", 0.6}};
  json scene_with(const std::string& key, const json& value) const {
    json scene = {
        {"schema", "semblance.cloth_scene/1"}, {"fabric", "cotton.json"}, {"sheet", sheet}};
    scene[key] = value;
    return scene;
  }

 private:
  TemporaryFolder folder_;
};

/// The first block of the page on the format.
std::string documented_example() {
  std::ifstream file(std::string(SEMBLANCE_DOCS) + "/formats/cloth-scene.md");
  std::string line, example;
  while (std::getline(file, line) && line != "```json") {
  }
  while (std::getline(file, line) && line != "```") example += line + "\n";
  return example;
}

TEST_F(SceneFile, TheDocumentedExampleIsRead) {
  const SimulationSetup setup = read(json::parse(documented_example()));
  EXPECT_EQ(setup.spacing_m, 0.02);
  const ClothScene scene = setup.make(setup.spacing_m);
  EXPECT_EQ(scene.sheet.grid->columns, 51);
  EXPECT_EQ(scene.obstacles.size(), 3u);
  EXPECT_EQ(scene.obstacles[1].name, "table");
  EXPECT_EQ(scene.fixed.size(), 41u);
  EXPECT_FALSE(scene.self_contact);
  ClothSystem system(scene);
  EXPECT_EQ(system.contacts().start_problem(scene.start_m), std::nullopt);
}

TEST_F(SceneFile, LaysSheetsAboutTheirMiddleAndTurnsThem) {
  json lying = sheet;
  lying["placement"] = {{"translation_m", {0.1, 0.2, 0.3}}, {"turn_deg", {90.0, 0.0, 0.0}}};
  const ClothScene scene = read(scene_with("sheet", lying)).make(0.1);
  const Eigen::RowVector3d low = scene.start_m.colwise().minCoeff();
  const Eigen::RowVector3d high = scene.start_m.colwise().maxCoeff();
  EXPECT_TRUE(low.isApprox(Eigen::RowVector3d(-0.4, -0.1, 0.3), 1e-9)) << low;
  EXPECT_TRUE(high.isApprox(Eigen::RowVector3d(0.6, 0.5, 0.3), 1e-9)) << high;
}

TEST_F(SceneFile, ReadsASheetFromAMesh) {
  const Sheet square = make_rectangle(0.2, 0.2, 0.1);
  Mesh mesh = square.mesh(lay_flat(square, {1.0, 2.0, 3.0}));
  mesh.uvs = square.material_m.cast<float>();
  write_mesh(path("square.obj"), mesh);
  const SimulationSetup setup =
      read(scene_with("sheet", {{"kind", "mesh"}, {"file", "square.obj"}}));
  EXPECT_FALSE(setup.has_spacing);
  const ClothScene scene = setup.make(0.5);
  EXPECT_EQ(scene.sheet.vertex_count(), 9);
  EXPECT_FALSE(scene.sheet.grid);
  EXPECT_TRUE(scene.start_m.isApprox(mesh.positions_m, 1e-9));
}

TEST_F(SceneFile, RefusesMeshesThatAreNoSheets) {
  const Sheet square = make_rectangle(0.2, 0.2, 0.1);
  Mesh mesh = square.mesh(lay_flat(square, {0.0, 0.0, 0.0}));
  mesh.triangles.row(0).swap(mesh.triangles.row(1));
  std::swap(mesh.triangles(1, 0), mesh.triangles(1, 1));
  write_mesh(path("inverted.obj"), mesh);
  const json inverted = {{"kind", "mesh"}, {"file", "inverted.obj"}};
  expect_refused(scene_with("sheet", inverted), "inverted");
  mesh.uvs.resize(0, 2);
  write_mesh(path("bare.obj"), mesh);
  expect_refused(scene_with("sheet", {{"kind", "mesh"}, {"file", "bare.obj"}}),
                 "no texture coordinates");
}

TEST_F(SceneFile, ReadsASequenceOfMeshes) {
  for (int k = 0; k < 3; ++k) {
    write_tetrahedron("body_" + std::to_string(8 + k) + ".obj", 0.1 * k);
  }
  write_tetrahedron("body_08.obj", 0.0);
  write_tetrahedron("body_09.obj", 0.1);
  write_tetrahedron("body_10.obj", 0.2);
  const ClothScene scene = read(scene_with("obstacles", {{{"kind", "mesh_sequence"},
                                                          {"name", "body"},
                                                          {"files", "body_##.obj"},
                                                          {"first", 8},
                                                          {"fps", 10}}}))
                               .make(0.1);
  EXPECT_NEAR(obstacle_mesh(scene.obstacles[0], 0.05).positions_m(0, 1), 0.05, 1e-9);
  EXPECT_NEAR(obstacle_mesh(scene.obstacles[0], 9.0).positions_m(0, 1), 0.2, 1e-9);
}

TEST_F(SceneFile, ReadsEveryKindOfBody) {
  write_tetrahedron("stone.ply", 1.0);
  const json bodies = {{{"kind", "plane"}, {"normal", {0, 2, 0}}},
                       {{"kind", "sphere"}, {"radius_m", 0.2}, {"translation_m", {0, -1, 0}}},
                       {{"kind", "drape_tester"}, {"top_centre_m", {3, 0, 0}}},
                       {{"kind", "mesh"}, {"file", "stone.ply"}, {"translation_m", {5, 0, 0}}}};
  const ClothScene scene = read(scene_with("obstacles", bodies)).make(0.1);
  ASSERT_EQ(scene.obstacles.size(), 5u);
  EXPECT_EQ(scene.obstacles[0].name, "plane 1");
  EXPECT_NEAR(obstacle_mesh(scene.obstacles[4], 0.0).positions_m.col(0).maxCoeff(), 6.0, 1e-9);
}

/// Of files in other units: scaled about the file's own origin, then turned and moved.
TEST_F(SceneFile, ScalesMeshesBeforeItPlacesThem) {
  write_tetrahedron("stone_0.obj", 1.0);
  const json bodies = {{{"kind", "mesh"},
                        {"file", "stone_0.obj"},
                        {"scale", 0.01},
                        {"turn_deg", {0, 0, 180}},
                        {"translation_m", {5, 0, 0}}},
                       {{"kind", "mesh_sequence"}, {"files", "stone_#.obj"}, {"scale", 0.01}}};
  const ClothScene scene = read(scene_with("obstacles", bodies)).make(0.1);
  const Points still = obstacle_mesh(scene.obstacles[0], 0.0).positions_m;
  EXPECT_NEAR(still(0, 0), 5.0, 1e-9);
  EXPECT_NEAR(still(0, 1), -0.01, 1e-9);
  EXPECT_NEAR(still(1, 0), 4.99, 1e-9);
  EXPECT_NEAR(obstacle_mesh(scene.obstacles[1], 0.0).positions_m(0, 1), 0.01, 1e-9);
  expect_refused(
      scene_with("obstacles", {{{"kind", "mesh"}, {"file", "stone_0.obj"}, {"scale", 0.0}}}),
      "scale");
}

/// A checkpoint must not go on among bodies that move otherwise, though they begin in the same
/// place.
TEST_F(SceneFile, MotionsAreOfTheRunsName) {
  write_tetrahedron("body_0.obj", -1.0);
  write_tetrahedron("body_1.obj", -0.8);
  const json body = {{{"kind", "mesh_sequence"}, {"files", "body_#.obj"}, {"fps", 1}}};
  const auto key = [&] {
    return simulation_key(read(scene_with("obstacles", body)).make(0.1), {});
  };
  const std::uint64_t first = key();
  EXPECT_EQ(key(), first);
  write_tetrahedron("body_1.obj", -0.7);
  EXPECT_NE(key(), first);
}

TEST_F(SceneFile, RefusesSequencesThatChangeTheirMesh) {
  write_tetrahedron("body_0.obj", 1.0);
  Mesh half = read_mesh(path("body_0.obj"));
  half.triangles.conservativeResize(2, 3);
  write_mesh(path("body_1.obj"), half);
  expect_refused(scene_with("obstacles", {{{"kind", "mesh_sequence"}, {"files", "body_#.obj"}}}),
                 "body_1.obj: its triangles are not those of the sequence's first file");
}

TEST_F(SceneFile, NamesWhatIsWrong) {
  expect_refused(json::object(), "\"semblance.cloth_scene/1\"");
  expect_refused({{"schema", "semblance.cloth_scene/1"}}, "sheet");
  expect_refused(scene_with("sheet", {{"kind", "rectangle"}, {"warp_m", 1.0}}), "weft_m");
  expect_refused(scene_with("sheet", {{"kind", "sock"}}), "rectangle, disc or mesh");
  expect_refused(scene_with("model", "rubber"), "choi-ko");
  expect_refused(scene_with("colour", "red"), "unknown key 'colour'");
  EXPECT_THAT([&] { read(scene_with("fabric", "silk.json")); },
              ThrowsMessage<IoError>(HasSubstr("silk.json")));
  expect_refused(scene_with("obstacles", {{{"kind", "cone"}}}), "mesh_sequence");
  expect_refused(scene_with("obstacles", {{{"kind", "box"}}}), "size_m");
  expect_refused(scene_with("obstacles", {{{"kind", "box"}, {"size_m", {1, -1, 1}}}}), "positive");
  expect_refused(scene_with("obstacles", {{{"kind", "mesh_sequence"}, {"files", "body.obj"}}}),
                 "walk_####.obj");
  expect_refused(scene_with("obstacles", {{{"kind", "mesh_sequence"}, {"files", "b_#.obj"}}}),
                 "no first file");
  expect_refused(scene_with("fixed", {{{"vertices", {0}}}}), "numbered from 1");
  expect_refused(scene_with("fixed", {{{"vertices", {100000}}}}), "fixed[0]: vertex 100000 of 77");
  expect_refused(scene_with("fixed", {{{"u_m", {2.0, 3.0}}}}), "no vertex lies in this region");
  expect_refused(scene_with("fixed", json::array({json::object()})), "\"u_m\"");
}

TEST_F(SceneFile, ListsAllProblemsAtOnce) {
  json scene = scene_with("model", "rubber");
  scene["self_contact"] = "yes";
  scene["colour"] = "red";
  EXPECT_THAT([&] { read(scene); },
              ThrowsMessage<InvalidInput>(
                  AllOf(HasSubstr("rubber"), HasSubstr("self_contact"), HasSubstr("colour"))));
}

}  // namespace
}  // namespace semblance::testing
