#include "semblance/io/mesh_io.h"

#include <gmock/gmock.h>

#include "files.h"
#include "semblance/core/errors.h"
#include "support.h"

namespace semblance {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::TemporaryFolder;
using ::testing::ThrowsMessage;
using testing::write_text;

Mesh pyramid(bool with_uvs) {
  Mesh mesh;
  mesh.positions_m.resize(4, 3);
  mesh.positions_m << 0, 0, 0, 1.0 / 3.0, 0, 0, 0, 1e-9, -1.7, 12345.678, 0, 0.1;
  mesh.triangles.resize(3, 3);
  mesh.triangles << 0, 1, 2, 0, 2, 3, 1, 3, 2;
  if (with_uvs) {
    mesh.uvs.resize(4, 2);
    mesh.uvs << 0, 0, 0.1f, 0, 0.3f, 1, 0.25f, 0.75f;
  }
  return mesh;
}

void expect_equal(const Mesh& found, const Mesh& expected) {
  EXPECT_EQ(found.positions_m, expected.positions_m);
  EXPECT_EQ(found.triangles, expected.triangles);
  EXPECT_EQ(found.uvs, expected.uvs);
}

TEST(MeshFiles, SurviveARoundTrip) {
  const TemporaryFolder folder;
  for (const bool with_uvs : {false, true}) {
    const Mesh mesh = pyramid(with_uvs);
    write_obj(folder.path() / "mesh.obj", mesh);
    expect_equal(read_obj(folder.path() / "mesh.obj").mesh, mesh);
    write_ply(folder.path() / "mesh.ply", mesh);
    expect_equal(read_ply(folder.path() / "mesh.ply"), mesh);
  }
}

TEST(Obj, FansPolygonsAndDoublesSeams) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "mesh.obj";
  write_text(path,
             "# two quads that meet in an edge with different texture coordinates\r\n"
             "mtllib m.mtl\no thing\nusemtl skin\n"
             "v 0 0 0\nv 1 0 0\nv 1 1 0 0.5 0.5 0.5\nv 0 1 0\nv 9 9 9\nv +2 0 0\nv 2 1 0\n"
             "vt 0 0\nvt 1 0\nvt 1 1 0\nvt 0 1\nvn 0 0 1\n"
             "f 1/1/1 2/2/1 3/3/1 4/4/1\nusemtl hair\nf -6/1 -2/2 -1/3 -5/4\n");
  const MeshFile file = read_obj(path);
  EXPECT_EQ(file.file_vertex_count, 7);
  EXPECT_EQ(file.mesh.triangle_count(), 4);
  // Vertices 2 and 3 (1 and 2 from 0) are doubled, the unused fifth is left out.
  EXPECT_THAT(file.file_vertex, ElementsAre(0, 1, 1, 2, 2, 3, 5, 6));
  EXPECT_THAT(file.materials, ElementsAre("skin", "hair"));
  EXPECT_THAT(file.triangle_material, ElementsAre(0, 0, 1, 1));
  // Every corner has the position and the texture coordinate that the file gives it.
  const auto corner = [&](int t, int c) { return file.mesh.triangles(t, c); };
  EXPECT_EQ(file.mesh.positions_m.row(corner(1, 2)), Eigen::RowVector3d(0, 1, 0));
  EXPECT_EQ(file.mesh.positions_m.row(corner(2, 0)), Eigen::RowVector3d(1, 0, 0));
  EXPECT_EQ(file.mesh.uvs.row(corner(2, 0)), Eigen::RowVector2f(0, 0));
  EXPECT_EQ(file.mesh.uvs.row(corner(0, 1)), Eigen::RowVector2f(1, 0));
  EXPECT_EQ(file.mesh.uvs.row(corner(3, 2)), Eigen::RowVector2f(0, 1));
}

TEST(Obj, LeavesOutHalvesWithoutArea) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "mesh.obj";
  write_text(path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3 3\n");
  EXPECT_EQ(read_obj(path).mesh.triangle_count(), 1);
}

TEST(Obj, KeepsUvsOnlyIfAllFacesHaveThem) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "mesh.obj";
  write_text(path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\nf 3 2 1\n");
  const MeshFile file = read_obj(path);
  EXPECT_EQ(file.mesh.uvs.rows(), 0);
  EXPECT_EQ(file.mesh.vertex_count(), 3);
}

struct BadMesh {
  const char* name;
  const char* content;
  const char* message;
};

class ObjRejects : public ::testing::TestWithParam<BadMesh> {};

TEST_P(ObjRejects, NamingFileAndLine) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "bad.obj";
  write_text(path, GetParam().content);
  EXPECT_THAT([&] { read_obj(path); },
              ThrowsMessage<InvalidInput>(AllOf(HasSubstr(path), HasSubstr(GetParam().message))));
}

INSTANTIATE_TEST_SUITE_P(
    All, ObjRejects,
    ::testing::Values(
        BadMesh{"Empty", "", "has no vertices"},
        BadMesh{"Text", "hello\nworld\n", "has no vertices"},
        BadMesh{"NoFaces", "v 0 0 0\n", "has no faces"},
        BadMesh{"Nan", "v 0 0 0\nv nan 0 0\n", ".obj:2: 'nan' is not a finite number"},
        BadMesh{"Infinite", "v 1e999 0 0\n", ":1: '1e999'"},
        BadMesh{"Short", "v 1 2\n", ":1: '' is not a finite number; 'v x y z'"},
        BadMesh{"Index", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", ":4: vertex 4 does not exist; 3"},
        BadMesh{"Zero", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", "vertex 0 does not exist"},
        BadMesh{"Negative", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -4 -2 -1\n", "vertex -4"},
        BadMesh{"Lowest", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -2147483648 -2 -1\n", "vertex -2147483648"},
        BadMesh{"Overflow", "v 0 0 0\nf 99999999999 1 1\n", "is not an index"},
        BadMesh{"Two", "v 0 0 0\nv 1 0 0\nf 1 2\n", "three corners"},
        BadMesh{"Uv", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/1 2/1 3/1\n", "texture coordinate 1"},
        BadMesh{"Word", "v 0 0 0\nf a b c\n", "'a' is not an index"},
        BadMesh{"OnlyDegenerate", "v 0 0 0\nv 1 0 0\nf 1 2 2\n", "has no faces"}),
    [](const auto& test) { return std::string(test.param.name); });

const std::string ply_header =
    "ply\nformat ascii 1.0\ncomment made by hand\nelement vertex 4\nproperty float x\nproperty "
    "float y\n"
    "property float z\nproperty uchar red\nelement face 1\nproperty list uchar int vertex_index\n"
    "property float quality\nend_header\n";

TEST(Ply, ReadsAsciiQuadsWithOtherProperties) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "mesh.ply";
  write_text(path, ply_header + "0 0 0 255\n1 0 0 255\n1 1 0 255\n0 1 0.5 255\n4 0 1 2 3 0.7\n");
  const Mesh mesh = read_ply(path);
  EXPECT_EQ(mesh.triangle_count(), 2);
  EXPECT_EQ(mesh.triangles.row(1), Eigen::RowVector3i(0, 2, 3));
  EXPECT_EQ(mesh.positions_m(3, 2), 0.5);
}

TEST(Ply, ReadsFloatBinary) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "mesh.ply";
  std::string content =
      "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
      "property float z\nelement face 1\nproperty list uchar uint vertex_indices\nend_header\n";
  const float positions[9] = {0, 0, 0, 1, 0, 0, 0, 2, 0.25f};
  content.append(reinterpret_cast<const char*>(positions), sizeof(positions));
  const std::uint32_t indices[3] = {0, 1, 2};
  content += '\3';
  content.append(reinterpret_cast<const char*>(indices), sizeof(indices));
  write_text(path, content);
  EXPECT_EQ(read_ply(path).positions_m.row(2), Eigen::RowVector3d(0, 2, 0.25));
  write_text(path, content.substr(0, content.size() - 1));
  EXPECT_THAT([&] { read_ply(path); }, ThrowsMessage<InvalidInput>(HasSubstr("ends too early")));
}

class PlyRejects : public ::testing::TestWithParam<BadMesh> {};

TEST_P(PlyRejects, WithAMessage) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "bad.ply";
  write_text(path, GetParam().content);
  EXPECT_THAT([&] { read_ply(path); },
              ThrowsMessage<InvalidInput>(AllOf(HasSubstr(path), HasSubstr(GetParam().message))));
}

#define PLY(vertices, faces)                                                    \
  "ply\nformat ascii 1.0\nelement vertex " vertices                             \
  "\nproperty float x\nproperty float y\nproperty float z\nelement face " faces \
  "\nproperty list uchar int vertex_indices\nend_header\n"

INSTANTIATE_TEST_SUITE_P(
    All, PlyRejects,
    ::testing::Values(BadMesh{"Empty", "", "ends too early"},
                      BadMesh{"Text", "hello\n", "first line must be 'ply'"},
                      BadMesh{"BigEndian", "ply\nformat binary_big_endian 1.0\n", "cannot be read"},
                      BadMesh{
                          "NoFaces",
                          "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nend_header\n",
                          "were expected"},
                      BadMesh{"HugeCount", PLY("2000000000", "1"), "more than the file can hold"},
                      BadMesh{"NegativeCount", PLY("-1", "1"), "'element NAME COUNT'"},
                      BadMesh{"Truncated", PLY("3", "1") "0 0 0\n1 0 0\n", "ends too early"},
                      BadMesh{"Index", PLY("3", "1") "0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", "vertex 3"},
                      BadMesh{"NegativeIndex", PLY("3", "1") "0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n",
                              "not a vertex number"},
                      BadMesh{"ListLength", PLY("3", "1") "0 0 0\n1 0 0\n0 1 0\n4000000000 0 1 2\n",
                              "has length"},
                      BadMesh{"Nan", PLY("1", "1") "nan 0 0\n3 0 0 0\n", "not a finite number"}),
    [](const auto& test) { return std::string(test.param.name); });

TEST(MeshFiles, ThatCannotBeWrittenAreIoErrors) {
  EXPECT_THROW(write_obj("/no/such/folder/mesh.obj", pyramid(false)), IoError);
  EXPECT_THROW(write_ply("/no/such/folder/mesh.ply", pyramid(false)), IoError);
  EXPECT_THROW(read_obj("/no/such/mesh.obj"), IoError);
}

}  // namespace
}  // namespace semblance
