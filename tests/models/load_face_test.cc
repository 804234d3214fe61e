#include "semblance/models/load_face.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>

#include "semblance/core/errors.h"
#include "semblance/io/gltf_writer.h"
#include "semblance/io/mesh_io.h"
#include "semblance/models/contract.h"
#include "small_face.h"
#include "support.h"

namespace semblance {
namespace {

using ::testing::HasSubstr;
using testing::small_face;
using testing::TemporaryFolder;
using ::testing::ThrowsMessage;

void write_text(const std::filesystem::path& path, const std::string& content) {
  std::ofstream(path) << content;
}

TEST(ParameterName, IsSnakeCaseWithSides) {
  EXPECT_EQ(parameter_name("mouthSmile_L"), "mouth_smile_left");
  EXPECT_EQ(parameter_name("jawOpen"), "jaw_open");
  EXPECT_EQ(parameter_name("browInnerUp"), "brow_inner_up");
  EXPECT_EQ(parameter_name("identity007"), "identity_007");
  EXPECT_EQ(parameter_name("eyeLookIn_R"), "eye_look_in_right");
  EXPECT_EQ(parameter_name("already_snake"), "already_snake");
  EXPECT_EQ(parameter_name("Key 1"), "key_1");
}

/// The shape's displacements at weight 1 as OBJ files, `unit_per_metre` as large.
void write_obj_folder(const std::filesystem::path& folder, double unit_per_metre) {
  const MorphShape shape = small_face();
  const auto write = [&](const char* name, const Eigen::Vector4d& values) {
    Mesh mesh = *shape.mesh;
    mesh.positions_m = unit_per_metre * shape_positions(shape, values).cast<double>();
    mesh.positions_m.col(1) *= 3;  // 0.27 m high, so that the unit can be told
    write_obj(folder / name, mesh);
  };
  write("face_neutral.obj", Eigen::Vector4d::Zero());
  write("identity_width.obj", Eigen::Vector4d::Unit(0));
  write("jawOpen.obj", Eigen::Vector4d::Unit(2));
  write("unmoved.obj", Eigen::Vector4d::Zero());
}

TEST(LoadFace, ReadsAFolderOfObjShapes) {
  const TemporaryFolder folder;
  write_obj_folder(folder.path(), 100.0);  // centimetres
  const MorphShape face = load_face(folder.path());
  ASSERT_EQ(face.parameters.size(), 2u);  // the unmoved shape is none
  EXPECT_EQ(face.parameters[0].name, "identity_width");
  EXPECT_EQ(face.parameters[1].name, "jaw_open");
  EXPECT_EQ(face.identity_count, 1);
  EXPECT_THAT(face.fields[1].vertices, ::testing::ElementsAre(3));
  EXPECT_NEAR(face.fields[1].displacement_m(0, 2), 0.006, 1e-6);
  const auto height =
      face.mesh->positions_m.col(1).maxCoeff() - face.mesh->positions_m.col(1).minCoeff();
  EXPECT_NEAR(height, 0.27, 1e-6);
  EXPECT_NEAR(face.mesh->positions_m.col(1).maxCoeff(), 0.135, 1e-6);
  EXPECT_MODEL_CONTRACT(MorphModel(face));
}

TEST(LoadFace, UsesLandmarksForUnitAndOrigin) {
  const TemporaryFolder folder;
  write_obj_folder(folder.path(), 1000.0);  // millimetres
  std::string list = "{\"landmark_vertices\":[";
  for (int i = 0; i < 68; ++i) {
    // Vertices 0 and 3 are 60 mm apart: all points of an eye at one of them.
    list += (i ? "," : "") + std::to_string(i >= 36 && i < 42 ? 0 : i >= 42 && i < 48 ? 3 : 7);
  }
  write_text(folder.path() / "landmarks.json", list + "]}");
  const MorphShape face = load_face(folder.path());
  ASSERT_EQ(face.landmarks.size(), 68u);
  EXPECT_EQ(face.landmarks[36].name, "landmark_36");
  Scene scene;
  const MorphModel model(face);
  model.synthesize(model.parameters().initial(), scene);
  const Eigen::Vector3d right = landmark_position(face.landmarks[36], scene);
  const Eigen::Vector3d left = landmark_position(face.landmarks[42], scene);
  EXPECT_NEAR((left - right).norm(), (Eigen::Vector3d(0.06, 0, 0.009)).norm(), 1e-6);
  EXPECT_LT((0.5 * (left + right) - Eigen::Vector3d(0, 0, 0.012)).norm(), 1e-6);
}

TEST(LoadFace, RejectsAFolderWithoutNeutral) {
  const TemporaryFolder folder;
  write_obj(folder.path() / "jawOpen.obj", *small_face().mesh);
  EXPECT_THAT([&] { load_face(folder.path()); },
              ThrowsMessage<InvalidInput>(HasSubstr("exactly one OBJ file with 'neutral'")));
}

TEST(LoadFace, RejectsShapesOfAnotherMesh) {
  const TemporaryFolder folder;
  write_obj_folder(folder.path(), 1.0);
  write_text(folder.path() / "other.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  EXPECT_THAT([&] { load_face(folder.path()); },
              ThrowsMessage<InvalidInput>(HasSubstr("export all shapes from one mesh")));
}

TEST(LoadFace, RejectsNeutralAlone) {
  const TemporaryFolder folder;
  write_obj(folder.path() / "neutral.obj", *small_face().mesh);
  EXPECT_THAT([&] { load_face(folder.path()); },
              ThrowsMessage<InvalidInput>(HasSubstr("no shape that moves the face")));
}

TEST(LoadFace, RejectsLandmarksOutsideTheMesh) {
  const TemporaryFolder folder;
  write_obj_folder(folder.path(), 1.0);
  std::string list = "{\"landmark_vertices\":[99";
  for (int i = 1; i < 68; ++i) list += ",0";
  write_text(folder.path() / "landmarks.json", list + "]}");
  EXPECT_THAT([&] { load_face(folder.path()); },
              ThrowsMessage<InvalidInput>(HasSubstr("from 0 to 19")));
}

TEST(LoadFace, RejectsUnknownNamesAndKinds) {
  const TemporaryFolder folder;
  write_text(folder.path() / "face.txt", "hello");
  EXPECT_THAT([&] { load_face(folder.path() / "face.txt"); },
              ThrowsMessage<InvalidInput>(HasSubstr("is not a face model")));
  EXPECT_THAT([&] { load_face("no-such-face"); },
              ThrowsMessage<InvalidInput>(HasSubstr("give 'builtin'")));
}

/// The small face as a scene for the writer, with the lip-like nonlinear fields as separate
/// targets.
GltfScene small_gltf() {
  const MorphShape shape = small_face();
  GltfScene scene;
  scene.mesh = *shape.mesh;
  scene.mesh.positions_m *= 4;  // 0.36 m high
  for (std::size_t i = 0; i < shape.fields.size(); ++i) {
    scene.targets.push_back(
        {"target" + std::to_string(i), shape.fields[i].vertices, shape.fields[i].displacement_m});
  }
  return scene;
}

TEST(LoadFace, ReadsMorphTargetsOfAGlb) {
  const TemporaryFolder folder;
  const GltfScene scene = small_gltf();
  const std::string path = folder.path() / "face.glb";
  write_glb(path, scene);
  const MorphShape face = load_face(path);
  ASSERT_EQ(face.fields.size(), scene.targets.size());
  for (std::size_t i = 0; i < face.fields.size(); ++i) {
    EXPECT_EQ(face.parameters[i].name, "target_" + std::to_string(i));
    EXPECT_EQ(face.fields[i].vertices, scene.targets[i].vertices);
    EXPECT_LT(
        (face.fields[i].displacement_m - scene.targets[i].displacement_m).cwiseAbs().maxCoeff(),
        1e-7f);
  }
  EXPECT_EQ(face.mesh->triangles, scene.mesh.triangles);
  EXPECT_MODEL_CONTRACT(MorphModel(face));
}

TEST(LoadFace, AppliesTheTransformOfTheNode) {
  // A triangle in the file itself; its node scales by two and turns x to y.
  const TemporaryFolder folder;
  const std::string path = folder.path() / "face.gltf";
  const std::string json = R"({"asset":{"version":"2.0"},
    "nodes":[{"children":[1],"scale":[2,2,2]},{"mesh":0,"rotation":[0,0,0.70710678118654757,0.70710678118654757]}],
    "meshes":[{"primitives":[{"attributes":{"POSITION":0},"targets":[{"POSITION":1}]}],
               "extras":{"targetNames":["jawOpen"]}}],
    "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},
                 {"bufferView":0,"byteOffset":36,"componentType":5126,"count":3,"type":"VEC3"}],
    "bufferViews":[{"buffer":0,"byteLength":72}],
    "buffers":[{"byteLength":72,"uri":"face.bin"}]})";
  write_text(path, json);
  const float values[18] = {0, 0, 0, 0.1f, 0, 0, 0, 0.1f, 0, 0, 0, 0, 0.01f, 0, 0, 0, 0, 0};
  std::ofstream(folder.path() / "face.bin", std::ios::binary)
      .write(reinterpret_cast<const char*>(values), sizeof(values));
  const MorphShape face = load_face(path);
  EXPECT_EQ(face.parameters[0].name, "jaw_open");
  const Eigen::Vector3d side = face.mesh->positions_m.row(1) - face.mesh->positions_m.row(0);
  EXPECT_LT((side - Eigen::Vector3d(0, 0.2, 0)).norm(), 1e-7);
  EXPECT_NEAR(face.fields[0].displacement_m(0, 1), 0.02, 1e-7);
}

struct BadGltf {
  const char* name;
  const char* json;
  const char* message;
};

class LoadFaceRejectsGltf : public ::testing::TestWithParam<BadGltf> {};

TEST_P(LoadFaceRejectsGltf, WithAMessage) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "face.gltf";
  write_text(path, GetParam().json);
  EXPECT_THAT([&] { load_face(path); },
              ThrowsMessage<InvalidInput>(
                  ::testing::AllOf(HasSubstr("face.gltf"), HasSubstr(GetParam().message))));
}

#define MESH_WITH(accessor)                                                              \
  R"({"asset":{"version":"2.0"},"meshes":[{"primitives":[{"attributes":{"POSITION":0},)" \
  R"("targets":[{"POSITION":0}]}]}],"accessors":[)" accessor                             \
  R"(],"bufferViews":[{"buffer":0,"byteLength":36}],"buffers":[{"byteLength":36,)"       \
  R"("uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]})"

INSTANTIATE_TEST_SUITE_P(
    All, LoadFaceRejectsGltf,
    ::testing::Values(
        BadGltf{"Text", "hello", "not valid JSON"},
        BadGltf{"NoMesh", R"({"asset":{"version":"2.0"}})", "morph targets was expected"},
        BadGltf{"TooManyRows",
                MESH_WITH(R"({"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"})"),
                "do not fit"},
        BadGltf{"HugeCount",
                MESH_WITH(R"({"componentType":5126,"count":4000000000,"type":"VEC3"})"),
                "rows was expected"},
        BadGltf{
            "Offset",
            MESH_WITH(
                R"({"bufferView":0,"byteOffset":999999,"componentType":5126,"count":1,"type":"VEC3"})"),
            "do not fit"},
        BadGltf{"View",
                MESH_WITH(R"({"bufferView":7,"componentType":5126,"count":3,"type":"VEC3"})"),
                "does not exist"},
        BadGltf{
            "OutsideFile",
            R"({"asset":{"version":"2.0"},"buffers":[{"byteLength":4,"uri":"../../../../etc/passwd"}]})",
            "not beside"}),
    [](const auto& test) { return std::string(test.param.name); });

TEST(LoadFace, RejectsATruncatedGlb) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "face.glb";
  write_glb(path, small_gltf());
  for (const double part : {0.9, 0.3, 0.01}) {
    std::filesystem::resize_file(
        path, static_cast<std::uintmax_t>(part * std::filesystem::file_size(path)));
    EXPECT_THROW(load_face(path), InvalidInput) << part;
  }
}

}  // namespace
}  // namespace semblance
