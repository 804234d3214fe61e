// Skins of glTF files made by hand, against closed forms; and what is refused.
#include "semblance/io/gltf_skin.h"

#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <functional>

#include "gltf_maker.h"
#include "semblance/core/errors.h"
#include "semblance/io/gltf_file.h"
#include "support.h"

namespace semblance::testing {
namespace {

using Eigen::Vector3d;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;
using Positions = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

class GltfSkin : public ::testing::Test {
 protected:
  SkinnedMesh read(const GltfMaker& maker) const {
    maker.write_binary(path("skin.glb"));
    return read_gltf_skin(path("skin.glb"));
  }
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }

 private:
  TemporaryFolder folder_;
};

Positions positions_at(const SkinnedMesh& skin, double time_s) {
  return skinned_positions(skin, animated_pose(skin.nodes, skin.animations.at(0), time_s));
}

void expect_bent_bar(const SkinnedMesh& skin, double time_s, double turn_rad, double tolerance_m) {
  const Positions positions_m = positions_at(skin, time_s);
  ASSERT_EQ(positions_m.rows(), 4 * bar_rings);
  for (int v = 0; v < positions_m.rows(); ++v) {
    EXPECT_LT((Vector3d(positions_m.row(v)) - bent_bar_vertex(v / 4, v % 4, turn_rad)).norm(),
              tolerance_m)
        << "vertex " << v << " at " << time_s << " s";
  }
}

TEST_F(GltfSkin, TwoJointsBendABar) {
  const GltfMaker maker = bending_bar(1.2);
  maker.write_text(path("bar.gltf"));
  maker.write_binary(path("bar.glb"));
  for (const char* name : {"bar.gltf", "bar.glb"}) {
    const SkinnedMesh skin = read_gltf_skin(path(name));
    ASSERT_EQ(skin.joints.size(), 2u);
    EXPECT_EQ(skin.nodes[skin.joints[1].node].name, "upper");
    EXPECT_EQ(skin.nodes[skin.joints[1].node].parent, skin.joints[0].node);
    EXPECT_EQ(skin.animations.at(0).name, "bend");
    EXPECT_EQ(skin.mesh.triangle_count(), 8 * (bar_rings - 1) + 4);
    for (const double t : {-1.0, 0.0, 0.3, 0.75, 1.0, 2.0}) {
      expect_bent_bar(skin, t, 1.2 * std::clamp(t, 0.0, 1.0), 1e-6);
    }
  }
}

TEST_F(GltfSkin, ReadsIntegersAsFractions) {
  GltfMaker maker = bending_bar(1.2);
  auto& attributes = maker.json["meshes"][0]["primitives"][0]["attributes"];
  std::vector<std::uint8_t> weights;
  for (int v = 0; v < 4 * bar_rings; ++v) {
    const auto upper = static_cast<std::uint8_t>(std::lround(255.0 * bar_weight(v / 4)));
    weights.insert(weights.end(), {upper, static_cast<std::uint8_t>(255 - upper), 0, 0});
  }
  attributes["WEIGHTS_0"] = maker.add(weights, "VEC4", true);
  std::vector<std::uint16_t> joints;
  for (int v = 0; v < 4 * bar_rings; ++v) joints.insert(joints.end(), {1, 0, 0, 0});
  attributes["JOINTS_0"] = maker.add(joints, "VEC4");
  const auto short_of = [](double x) {
    return static_cast<std::int16_t>(std::lround(32767.0 * x));
  };
  const std::vector<std::int16_t> turns = {
      0, 0, 0, 32767, 0, 0, short_of(std::sin(-0.6)), short_of(std::cos(-0.6))};
  maker.json["animations"][0]["samplers"][0]["output"] = maker.add(turns, "VEC4", true);
  // The bar is 2 m long: half a step of the weights, and of the turns.
  expect_bent_bar(read(maker), 1.0, -1.2, 2.0 * 0.5 / 255 + 2.0 / 32767);
}

TEST_F(GltfSkin, ReadsSparseAccessors) {
  GltfMaker maker = bending_bar(1.2);
  const int number = maker.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"];
  const SkinnedMesh before = read(maker);
  const int rows = maker.add_view(std::vector<std::uint16_t>{3, 17});
  const int values = maker.add_view(std::vector<float>{7, 8, 9, -1, -2, -3});
  maker.json["accessors"][number]["sparse"] = {
      {"count", 2},
      {"indices", {{"bufferView", rows}, {"componentType", 5123}}},
      {"values", {{"bufferView", values}}}};
  const SkinnedMesh after = read(maker);
  EXPECT_EQ(Vector3d(after.mesh.positions_m.row(3)), Vector3d(7, 8, 9));
  EXPECT_EQ(Vector3d(after.mesh.positions_m.row(17)), Vector3d(-1, -2, -3));
  EXPECT_EQ(after.mesh.positions_m.row(4), before.mesh.positions_m.row(4));
}

/// Weights of two sets that add up to 2 are halved; those of one joint add up.
TEST_F(GltfSkin, JoinsSetsOfWeights) {
  GltfMaker maker = bending_bar(1.2);
  auto& attributes = maker.json["meshes"][0]["primitives"][0]["attributes"];
  std::vector<float> weights;
  std::vector<std::uint8_t> joints;
  for (int v = 0; v < 4 * bar_rings; ++v) {
    weights.insert(weights.end(), {0.0f, 0.25f, 0.0f, 0.75f});
    joints.insert(joints.end(), {200, 1, 0, 1});  // what has no weight may be any joint
  }
  attributes["JOINTS_1"] = maker.add(joints, "VEC4");
  attributes["WEIGHTS_1"] = maker.add(weights, "VEC4");
  const SkinnedMesh skin = read(maker);
  for (int v = 0; v < 4 * bar_rings; ++v) {
    EXPECT_NEAR(skin.weights.coeff(v, 1), 0.5 * (bar_weight(v / 4) + 1.0), 1e-6);
    EXPECT_NEAR(skin.weights.coeff(v, 0) + skin.weights.coeff(v, 1), 1.0, 1e-12);
  }
}

/// A triangle that a node turns and moves; and another node with it, which mirrors.
GltfMaker swinging_triangle() {
  GltfMaker maker;
  const int positions = maker.add(std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0}, "VEC3");
  maker.json["meshes"] = {{{"primitives", {{{"attributes", {{"POSITION", positions}}}}}}}};
  maker.json["nodes"] = {
      {{"name", "hinge"}, {"children", {1, 2}}},
      {{"mesh", 0}, {"translation", {1, 0, 0}}},
      {{"mesh", 0}, {"matrix", {-2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 0, 0, 5, 1}}},
      {{"mesh", 0}, {"translation", {100, 0, 0}}}};
  maker.json["scenes"] = {{{"nodes", {3}}}, {{"nodes", {0}}}};
  maker.json["scene"] = 1;
  maker.json["animations"] = {{{"name", "swing"}}};
  const int times = maker.add(std::vector<float>{0, 2}, "SCALAR");
  const auto half = static_cast<float>(std::sqrt(0.5));
  const int turns = maker.add(std::vector<float>{0, 0, 0, 1, 0, 0, half, half}, "VEC4");
  maker.add_channel(0, "rotation", times, turns);
  const int moves = maker.add(std::vector<float>{1, 0, 0, 1, 2, 0}, "VEC3");
  maker.add_channel(1, "translation", times, moves, "STEP");
  return maker;
}

TEST_F(GltfSkin, MeshesWithoutSkinFollowTheirNodes) {
  const SkinnedMesh skin = read(swinging_triangle());
  ASSERT_EQ(skin.mesh.vertex_count(), 6);  // the third node is not in the scene
  ASSERT_EQ(skin.joints.size(), 2u);
  const Positions middle = positions_at(skin, 1.0), end = positions_at(skin, 2.0);
  const double half = std::sqrt(0.5);
  EXPECT_LT((Vector3d(middle.row(1)) - Vector3d(2 * half, 2 * half, 0)).norm(), 1e-6);
  EXPECT_LT((Vector3d(end.row(1)) - Vector3d(-2, 2, 0)).norm(), 1e-6);
  EXPECT_LT((Vector3d(end.row(4)) - Vector3d(0, -2, 5)).norm(), 1e-6);
  EXPECT_LT((Vector3d(end.row(5)) - Vector3d(-2, 0, 5)).norm(), 1e-6);
  // Of the mirrored one too, the outside stays outside.
  for (int t = 0; t < 2; ++t) {
    const auto corner = [&](int k) { return Vector3d(end.row(skin.mesh.triangles(t, k))); };
    EXPECT_GT((corner(1) - corner(0)).cross(corner(2) - corner(0)).z(), 0.0);
  }
}

TEST_F(GltfSkin, MeshesOfOneSkinShareItsJoints) {
  GltfMaker maker = bending_bar(1.2);
  maker.json["nodes"].push_back(maker.json["nodes"][0]);
  maker.json["scenes"][0]["nodes"].push_back(3);
  auto& primitives = maker.json["meshes"][0]["primitives"];
  primitives.push_back(primitives[0]);
  const SkinnedMesh skin = read(maker);
  EXPECT_EQ(skin.joints.size(), 2u);
  EXPECT_EQ(skin.mesh.vertex_count(), 4 * 4 * bar_rings);
  const Positions bent = positions_at(skin, 1.0);
  EXPECT_EQ(without_seams(skin).mesh.vertex_count(), 4 * bar_rings);
  EXPECT_EQ(bent.topRows(4 * bar_rings), bent.bottomRows(4 * bar_rings));
}

/// A skin's own node moves nothing, and without inverse bind matrices the mesh is in the joints'
/// frames (section 3.7.3.2).
TEST_F(GltfSkin, JointsAloneMoveASkin) {
  GltfMaker maker = bending_bar(1.2);
  maker.json["nodes"][0]["translation"] = {9, 9, 9};
  expect_bent_bar(read(maker), 0.5, 0.6, 1e-6);
  maker.json["skins"][0].erase("inverseBindMatrices");
  const SkinnedMesh skin = read(maker);
  const Positions rest = skinned_positions(skin, rest_pose(skin.nodes));
  const int top = 4 * (bar_rings - 1);
  EXPECT_LT((Vector3d(rest.row(top)) - bar_vertex(bar_rings - 1, 0) - Vector3d(0, 1, 0)).norm(),
            1e-6);
}

TEST_F(GltfSkin, ReadsAMatrixAsScaleRotationAndTranslation) {
  GltfMaker maker = swinging_triangle();
  // Columns: z times 2, -x times 3, -y times 4.
  maker.json["nodes"][2]["matrix"] = {0, 0, 2, 0, -3, 0, 0, 0, 0, -4, 0, 0, 7, 8, 9, 1};
  const SkinnedMesh skin = read(maker);
  const NodeTransform& rest = skin.nodes[skin.joints[1].node].rest;
  EXPECT_LT((rest.scale - Vector3d(2, 3, 4)).norm(), 1e-12);
  EXPECT_LT((rest.translation_m - Vector3d(7, 8, 9)).norm(), 1e-12);
  EXPECT_LT((rest.rotation * Vector3d::UnitX() - Vector3d::UnitZ()).norm(), 1e-12);
  EXPECT_LT((rest.rotation * Vector3d::UnitY() + Vector3d::UnitX()).norm(), 1e-12);
}

TEST_F(GltfSkin, TextureCoordinatesAreKeptIfAllPartsHaveThem) {
  GltfMaker maker = swinging_triangle();
  auto& attributes = maker.json["meshes"][0]["primitives"][0]["attributes"];
  attributes["TEXCOORD_0"] = maker.add(std::vector<float>{0, 0, 1, 0, 0, 0.25f}, "VEC2");
  const SkinnedMesh skin = read(maker);
  ASSERT_EQ(skin.mesh.uvs.rows(), 6);
  EXPECT_EQ(skin.mesh.uvs(5, 1), 0.75f);  // v runs up
}

struct BadSkin {
  const char* name;
  std::function<void(GltfMaker&)> spoil;
  const char* message;
};

class GltfSkinRefuses : public ::testing::TestWithParam<BadSkin> {};

TEST_P(GltfSkinRefuses, WithAMessage) {
  const TemporaryFolder folder;
  const std::string path = (folder.path() / "bad.glb").string();
  GltfMaker maker = bending_bar(1.2);
  GetParam().spoil(maker);
  maker.write_binary(path);
  EXPECT_THAT(
      [&] { read_gltf_skin(path); },
      ThrowsMessage<InvalidInput>(AllOf(HasSubstr("bad.glb"), HasSubstr(GetParam().message))));
}

nlohmann::json& attributes_of(GltfMaker& maker) {
  return maker.json["meshes"][0]["primitives"][0]["attributes"];
}

/// As many rows of four as the bar has vertices.
template <typename T>
std::vector<T> rows_of_four(T a, T b, T c, T d) {
  std::vector<T> values;
  for (int v = 0; v < 4 * bar_rings; ++v) values.insert(values.end(), {a, b, c, d});
  return values;
}

INSTANTIATE_TEST_SUITE_P(
    All, GltfSkinRefuses,
    ::testing::Values(
        BadSkin{"JointOutOfRange",
                [](GltfMaker& m) {
                  attributes_of(m)["JOINTS_0"] =
                      m.add(rows_of_four<std::uint8_t>(0, 2, 0, 0), "VEC4");
                },
                "vertex 0 has weight 1 of joint 2: positive weights of joints 0 to 1"},
        BadSkin{"NoJoints", [](GltfMaker& m) { attributes_of(m).erase("JOINTS_0"); }, "(JOINTS)"},
        BadSkin{"NoWeights", [](GltfMaker& m) { attributes_of(m).erase("WEIGHTS_0"); },
                "(WEIGHTS)"},
        BadSkin{"FewWeights",
                [](GltfMaker& m) {
                  attributes_of(m)["WEIGHTS_0"] = m.add(std::vector<float>(8, 0.5f), "VEC4");
                },
                "36 rows of joints and 2 of weights for 36 vertices"},
        BadSkin{"NegativeWeight",
                [](GltfMaker& m) {
                  attributes_of(m)["WEIGHTS_0"] =
                      m.add(rows_of_four(1.5f, -0.5f, 0.0f, 0.0f), "VEC4");
                },
                "weight -0.5"},
        BadSkin{"NoWeightAtAll",
                [](GltfMaker& m) {
                  attributes_of(m)["WEIGHTS_0"] = m.add(rows_of_four(0.f, 0.f, 0.f, 0.f), "VEC4");
                },
                "no joint has a weight of vertex 0"},
        BadSkin{"NanPosition",
                [](GltfMaker& m) {
                  std::vector<float> values(12 * bar_rings, 0.0f);
                  values[7] = std::nanf("");
                  attributes_of(m)["POSITION"] = m.add(values, "VEC3");
                },
                "vertex positions: a value is not finite"},
        BadSkin{"NoPositions", [](GltfMaker& m) { attributes_of(m).erase("POSITION"); },
                "vertex positions"},
        BadSkin{"ZerosThatAreNotStored",
                [](GltfMaker& m) {
                  m.json["accessors"].push_back(
                      {{"componentType", 5126}, {"count", 10000000}, {"type", "VEC3"}});
                  attributes_of(m)["POSITION"] = m.json["accessors"].size() - 1;
                },
                "more numbers than are read of a file of its size"},
        BadSkin{"AbsentSkin", [](GltfMaker& m) { m.json["nodes"][0]["skin"] = 3; },
                "skin: number 3 does not exist"},
        BadSkin{"AbsentJoint",
                [](GltfMaker& m) {
                  m.json["skins"][0]["joints"] = {1, 44};
                },
                "joint of a skin: number 44 does not exist"},
        BadSkin{"NoJointsInSkin",
                [](GltfMaker& m) { m.json["skins"][0]["joints"] = nlohmann::json::array(); },
                "skin 0 has no joints"},
        BadSkin{"FewInverseBindMatrices",
                [](GltfMaker& m) {
                  m.json["skins"][0]["joints"] = {1, 2, 1};
                },
                "2 inverse bind matrices for 3 joints"},
        BadSkin{"ProjectiveInverseBindMatrix",
                [](GltfMaker& m) {
                  m.json["skins"][0]["inverseBindMatrices"] =
                      m.add(std::vector<float>(32, 1.0f), "MAT4");
                },
                "last row"},
        BadSkin{"AbsentMesh", [](GltfMaker& m) { m.json["nodes"][0]["mesh"] = 1; },
                "mesh: number 1 does not exist"},
        BadSkin{"CyclicNodes", [](GltfMaker& m) { m.json["nodes"][2]["children"] = {1}; },
                "their own ancestors"},
        BadSkin{"TwoParents", [](GltfMaker& m) { m.json["nodes"][0]["children"] = {2}; },
                "node 2 is the child of two nodes"},
        BadSkin{"AbsentChild", [](GltfMaker& m) { m.json["nodes"][0]["children"] = {-7}; },
                "child of a node: number -7 does not exist"},
        BadSkin{"AbsentRoot",
                [](GltfMaker& m) {
                  m.json["scenes"][0]["nodes"] = {0, 9};
                },
                "node of a scene: number 9 does not exist"},
        BadSkin{"AbsentScene", [](GltfMaker& m) { m.json["scene"] = 2; },
                "scene: number 2 does not exist"},
        BadSkin{"ShearingMatrix",
                [](GltfMaker& m) {
                  m.json["nodes"][1]["matrix"] = {1, 0, 0, 0, 0.5, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
                },
                "not a scale, a rotation and a translation"},
        BadSkin{"ZeroRotation",
                [](GltfMaker& m) {
                  m.json["nodes"][1]["rotation"] = {0, 0, 0, 0};
                },
                "node 1 ('lower'): its rotation is not a unit quaternion"},
        BadSkin{"ShortTranslation",
                [](GltfMaker& m) {
                  m.json["nodes"][1]["translation"] = {1, 2};
                },
                "translation of 3"},
        BadSkin{"Lines", [](GltfMaker& m) { m.json["meshes"][0]["primitives"][0]["mode"] = 1; },
                "separate triangles"},
        BadSkin{"EmptyScene", [](GltfMaker& m) { m.json["scenes"][0]["nodes"] = {1}; },
                "has no triangle"},
        BadSkin{"Compressed",
                [](GltfMaker& m) { m.json["extensionsRequired"] = {"KHR_draco_mesh_compression"}; },
                "export it without compression"},
        BadSkin{"SamplerLengthsDiffer",
                [](GltfMaker& m) {
                  m.json["animations"][0]["samplers"][0]["input"] =
                      m.add(std::vector<float>{0, 1, 2}, "SCALAR");
                },
                "animation 'bend', channel 0: 2 rows of 4 numbers for 3 keys"},
        BadSkin{"FewRowsOfASpline",
                [](GltfMaker& m) {
                  m.json["animations"][0]["samplers"][0]["interpolation"] = "CUBICSPLINE";
                },
                "3 per key"},
        BadSkin{"TimesRunBack",
                [](GltfMaker& m) {
                  m.json["animations"][0]["samplers"][0]["input"] =
                      m.add(std::vector<float>{1, 0}, "SCALAR");
                },
                "times must ascend"},
        BadSkin{"InfiniteTime",
                [](GltfMaker& m) {
                  m.json["animations"][0]["samplers"][0]["input"] =
                      m.add(std::vector<float>{0, HUGE_VALF}, "SCALAR");
                },
                "times of an animation: a value is not finite"},
        BadSkin{"ZeroTurn",
                [](GltfMaker& m) {
                  m.json["animations"][0]["samplers"][0]["output"] =
                      m.add(std::vector<float>(8, 0.0f), "VEC4");
                },
                "the rotation of key 0 is zero"},
        BadSkin{"UnknownInterpolation",
                [](GltfMaker& m) {
                  m.json["animations"][0]["samplers"][0]["interpolation"] = "QUINTIC";
                },
                "LINEAR, STEP or CUBICSPLINE expected"},
        BadSkin{"AbsentSampler",
                [](GltfMaker& m) { m.json["animations"][0]["channels"][0]["sampler"] = 5; },
                "sampler of a channel: number 5 does not exist"},
        BadSkin{"AnimatedNodeAbsent",
                [](GltfMaker& m) { m.json["animations"][0]["channels"][0]["target"]["node"] = 5; },
                "node of a channel: number 5 does not exist"}),
    [](const auto& test) { return std::string(test.param.name); });

TEST_F(GltfSkin, RefusesAFileThatEndsTooEarly) {
  const std::string whole = bending_bar(1.2).binary();
  for (std::size_t size = 0; size < whole.size(); size += 97) {
    std::ofstream(path("part.glb"), std::ios::binary) << whole.substr(0, size);
    EXPECT_THAT([&] { read_gltf_skin(path("part.glb")); },
                ThrowsMessage<InvalidInput>(HasSubstr("part.glb")))
        << size;
  }
}

TEST_F(GltfSkin, ReadsNoFilesFromElsewhere) {
  std::filesystem::create_directory(path("inner"));
  bending_bar(1.2).write_text(path("inner/bar.gltf"));
  std::filesystem::rename(path("inner/bar.gltf"), path("bar.gltf"));
  EXPECT_THROW(read_gltf_skin(path("bar.gltf")), InvalidInput);
  std::ifstream file(path("bar.gltf"));
  nlohmann::json json = nlohmann::json::parse(file);
  json["buffers"][0]["uri"] = "inner/bar.gltf.bin";
  std::ofstream(path("bar.gltf")) << json;
  EXPECT_THAT([&] { read_gltf_skin(path("bar.gltf")); },
              ThrowsMessage<InvalidInput>(HasSubstr("is not beside")));
  EXPECT_THROW(read_gltf_skin(path("absent.glb")), IoError);
}

}  // namespace
}  // namespace semblance::testing
