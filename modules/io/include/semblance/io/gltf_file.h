// The parts of a glTF 2.0 file (Khronos Group 2021), text or binary, as it has them. Files are not
// trusted: every index and range is checked, files that it names are read only from its own folder,
// and all that is read of it is bounded. Skins are put together in gltf_skin.h, faces in the
// models.
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "semblance/geometry/skinned_mesh.h"

namespace semblance {

/// A morph target: how the vertices move at weight 1, a row for each.
struct GltfShape {
  std::string name;  // of mesh.extras.targetNames, else shape_000 and so on
  PointsF displacement;
};

/// A mesh of the file where a node puts it.
struct GltfInstance {
  int node = 0, mesh = 0;
  int skin = -1;         // none: the mesh is in the node's frame
  bool in_scene = true;  // in the scene that the file shows
};

class GltfFile {
 public:
  /// `source` names the file in messages, and files that it names are beside it. Throws
  /// InvalidInput where it is no such file, is damaged or larger than 1 GiB, nodes do not make a
  /// tree or have transforms that are not translation, rotation and scale, and where it needs an
  /// extension that compresses meshes. So do all functions below where the part they read is
  /// damaged.
  GltfFile(std::string_view content, const std::string& source);
  ~GltfFile();
  GltfFile(const GltfFile&) = delete;
  GltfFile& operator=(const GltfFile&) = delete;

  /// All nodes (section 3.5), parents first: not in the file's order.
  const std::vector<SkinNode>& nodes() const;
  /// Nodes with a mesh, in the file's order.
  const std::vector<GltfInstance>& instances() const;

  int mesh_count() const;
  int shape_count(int mesh) const;
  /// Primitives of a mesh as one, in its own frame; uvs if every primitive has them, v up. Vertices
  /// are in the file's order, triangles that name a vertex twice are left out.
  Mesh mesh(int index) const;
  std::vector<GltfShape> shapes(int mesh) const;
  /// All sets of weights of a mesh (section 3.7.3.3): vertices x joints, each row with sum 1.
  Eigen::SparseMatrix<double, Eigen::RowMajor> weights(int mesh, int joint_count) const;
  /// Joints of a skin in its order.
  std::vector<SkinJoint> joints(int skin) const;
  /// Channels of translation, rotation and scale; those of weights of morph targets and of
  /// extensions are left out.
  std::vector<SkinAnimation> animations() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// IoError where the file cannot be read.
GltfFile read_gltf(const std::string& path);

}  // namespace semblance
