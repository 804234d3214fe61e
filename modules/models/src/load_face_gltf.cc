// A mesh with morph targets from glTF 2.0, text or binary.
#include <fmt/format.h>

#include <cmath>
#include <filesystem>

#include "load_face_parts.h"
#include "semblance/core/errors.h"
#include "semblance/io/gltf_file.h"

namespace semblance::load {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const std::string& source, const std::string& what) {
  throw InvalidInput(fmt::format("{}: {}", source, what));
}

/// One mesh of the file with its primitives joined.
struct GltfFace {
  MeshFile file;
  std::vector<NamedShape> shapes;
};

/// The mesh with most morph targets is the face.
int face_mesh(const GltfFile& file, const std::string& source) {
  int most = 0, face = -1;
  for (int i = 0; i < file.mesh_count(); ++i) {
    if (file.shape_count(i) <= most) continue;
    most = file.shape_count(i);
    face = i;
  }
  constexpr int most_targets = 4096;
  if (face < 0 || most > most_targets) {
    fail(source, fmt::format("a mesh with 1 to {} morph targets was expected", most_targets));
  }
  return face;
}

GltfFace read_face(const GltfFile& file, int index, const std::string& source) {
  GltfFace face;
  face.file.mesh = file.mesh(index);
  if (face.file.mesh.triangle_count() == 0) fail(source, "the mesh has no triangle");
  face.file.file_vertex_count = static_cast<int>(face.file.mesh.vertex_count());
  for (int i = 0; i < face.file.file_vertex_count; ++i) face.file.file_vertex.push_back(i);
  for (GltfShape& shape : file.shapes(index)) {
    face.shapes.push_back({std::move(shape.name), std::move(shape.displacement)});
  }
  return face;
}

/// World from mesh, by the first node with the mesh.
Eigen::Affine3d placement(const GltfFile& file, int mesh) {
  for (const GltfInstance& instance : file.instances()) {
    if (instance.mesh != mesh) continue;
    return world_from_nodes(file.nodes(), rest_pose(file.nodes()))[instance.node];
  }
  return Eigen::Affine3d::Identity();
}

void place(const Eigen::Affine3d& transform, const std::string& source, GltfFace& face) {
  if (!transform.matrix().allFinite() || std::abs(transform.linear().determinant()) < 1e-12) {
    fail(source, "the transform of the face's node is not usable");
  }
  Mesh& mesh = face.file.mesh;
  mesh.positions_m = (mesh.positions_m * transform.linear().transpose()).eval();
  mesh.positions_m.rowwise() += transform.translation().transpose();
  const Eigen::Matrix3f linear = transform.linear().cast<float>();
  for (NamedShape& shape : face.shapes) {
    shape.displacement = (shape.displacement * linear.transpose()).eval();
  }
}

MorphShape face_of(const GltfFile& file, const std::string& source,
                   const FaceLoadOptions& options) {
  const int mesh = face_mesh(file, source);
  GltfFace face = read_face(file, mesh, source);
  place(placement(file, mesh), source, face);
  const fs::path landmarks = fs::path(source).replace_extension(".landmarks.json");
  return assemble(face.file, std::move(face.shapes), landmarks.string(), source, options);
}

}  // namespace

MorphShape gltf_face_from_bytes(std::string_view content, const std::string& source,
                                const FaceLoadOptions& options) {
  return face_of(GltfFile(content, source), source, options);
}

MorphShape gltf_face(const std::string& path, const FaceLoadOptions& options) {
  return face_of(read_gltf(path), path, options);
}

}  // namespace semblance::load
