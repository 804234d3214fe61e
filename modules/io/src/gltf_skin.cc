#include "semblance/io/gltf_skin.h"

#include <map>

#include "parsers.h"
#include "semblance/core/errors.h"
#include "semblance/io/gltf_file.h"

namespace semblance {
namespace {

/// Appends the parts one after the other.
class SkinBuilder {
 public:
  explicit SkinBuilder(const GltfFile& file) : file_(file) {
    skin_.nodes = file.nodes();
    world_from_node_ = world_from_nodes(skin_.nodes, rest_pose(skin_.nodes));
  }

  void add(const GltfInstance& instance) {
    Mesh mesh = file_.mesh(instance.mesh);
    if (mesh.triangle_count() == 0) return;
    if (instance.skin >= 0) {
      const JointRange joints = joints_of(instance.skin);
      add_weights(file_.weights(instance.mesh, joints.count), joints.first);
    } else {
      const int joint = static_cast<int>(skin_.joints.size());
      skin_.joints.push_back({instance.node, Eigen::Affine3d::Identity()});
      for (int v = 0; v < mesh.vertex_count(); ++v) {
        weights_.emplace_back(vertex_count_ + v, joint, 1.0);
      }
      // A mirror image is seen from inside (section 3.7.4).
      if (world_from_node_[instance.node].linear().determinant() < 0.0) {
        mesh.triangles.col(1).swap(mesh.triangles.col(2));
      }
    }
    mesh.triangles.array() += vertex_count_;
    vertex_count_ += static_cast<int>(mesh.vertex_count());
    parts_.push_back(std::move(mesh));
  }

  SkinnedMesh finish() {
    join_parts();
    skin_.weights.resize(vertex_count_, static_cast<Eigen::Index>(skin_.joints.size()));
    skin_.weights.setFromTriplets(weights_.begin(), weights_.end());
    skin_.animations = file_.animations();
    return std::move(skin_);
  }

 private:
  struct JointRange {
    int first = 0, count = 0;
  };

  /// Meshes with one skin share its joints.
  JointRange joints_of(int skin) {
    const auto [found, is_new] = of_skin_.try_emplace(skin);
    if (is_new) {
      const std::vector<SkinJoint> joints = file_.joints(skin);
      found->second = {static_cast<int>(skin_.joints.size()), static_cast<int>(joints.size())};
      skin_.joints.insert(skin_.joints.end(), joints.begin(), joints.end());
    }
    return found->second;
  }

  void add_weights(const Eigen::SparseMatrix<double, Eigen::RowMajor>& weights, int first_joint) {
    for (Eigen::Index v = 0; v < weights.rows(); ++v) {
      for (decltype(SkinnedMesh::weights)::InnerIterator it(weights, v); it; ++it) {
        weights_.emplace_back(vertex_count_ + static_cast<int>(v),
                              first_joint + static_cast<int>(it.col()), it.value());
      }
    }
  }

  void join_parts() {
    Eigen::Index triangle_count = 0;
    bool has_uvs = true;
    for (const Mesh& part : parts_) {
      triangle_count += part.triangle_count();
      has_uvs &= part.uvs.rows() == part.vertex_count();
    }
    Mesh& mesh = skin_.mesh;
    mesh.positions_m.resize(vertex_count_, 3);
    mesh.triangles.resize(triangle_count, 3);
    mesh.uvs.resize(has_uvs ? vertex_count_ : 0, 2);
    Eigen::Index vertex = 0, triangle = 0;
    for (const Mesh& part : parts_) {
      mesh.positions_m.middleRows(vertex, part.vertex_count()) = part.positions_m;
      mesh.triangles.middleRows(triangle, part.triangle_count()) = part.triangles;
      if (has_uvs) mesh.uvs.middleRows(vertex, part.vertex_count()) = part.uvs;
      vertex += part.vertex_count();
      triangle += part.triangle_count();
    }
  }

  const GltfFile& file_;
  SkinnedMesh skin_;
  std::vector<Eigen::Affine3d> world_from_node_;
  std::map<int, JointRange> of_skin_;
  std::vector<Mesh> parts_;
  std::vector<Eigen::Triplet<double>> weights_;
  int vertex_count_ = 0;
};

SkinnedMesh skin_of(const GltfFile& file, const std::string& source) {
  SkinBuilder builder(file);
  for (const GltfInstance& instance : file.instances()) {
    if (instance.in_scene) builder.add(instance);
  }
  SkinnedMesh skin = builder.finish();
  if (skin.mesh.triangle_count() == 0) {
    throw InvalidInput(source + ": its scene has no triangle; a node with a mesh was expected");
  }
  validate(skin, source);
  return skin;
}

}  // namespace

SkinnedMesh parse_gltf_skin(std::string_view content, const std::string& source) {
  return skin_of(GltfFile(content, source), source);
}

SkinnedMesh read_gltf_skin(const std::string& path) { return skin_of(read_gltf(path), path); }

}  // namespace semblance
