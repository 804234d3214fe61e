// Meshes that joints move: linear-blend skinning, and animations of the joints. The concepts, and
// what is said of them here, are those of the glTF 2.0 specification (Khronos Group 2021), sections
// 3.5 (nodes), 3.7.3 (skins) and 3.11 and C (animations), so that any skin of such a file fits.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/SparseCore>
#include <string>
#include <vector>

#include "semblance/core/mesh.h"

namespace semblance {

/// Parent from node: scaled along the node's axes, then rotated, then translated.
struct NodeTransform {
  Eigen::Vector3d translation_m = Eigen::Vector3d::Zero();
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  // unit
  Eigen::Vector3d scale = Eigen::Vector3d::Ones();

  Eigen::Affine3d parent_from_node() const;
};

/// One of a tree of frames. Frames without a parent stand in the world.
struct SkinNode {
  std::string name;
  int parent = -1;  // smaller than its own number
  NodeTransform rest;
};

/// A node that moves vertices, and what takes them into its frame (the inverse bind matrix).
struct SkinJoint {
  int node = 0;
  Eigen::Affine3d joint_from_mesh = Eigen::Affine3d::Identity();
};

enum class NodeProperty { translation, rotation, scale };
enum class Interpolation { step, linear, cubic_spline };

/// One property of one node over time. Before the first key and after the last it stays as there.
struct AnimationChannel {
  int node = 0;
  NodeProperty property = NodeProperty::translation;
  Interpolation interpolation = Interpolation::linear;
  std::vector<double> times_s;  // of the keys, ascending
  /// A row per key: 3 numbers, or 4 of a rotation (x, y, z, w). Of a cubic spline three rows per
  /// key: the derivative (1/s) before it, its value, the derivative after it.
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> values;
};

struct SkinAnimation {
  std::string name;
  std::vector<AnimationChannel> channels;

  double end_s() const;  // the last key's time; 0 without keys
};

/// A mesh as it was bound to its joints, and how these can move. A rigid part is a part with one
/// joint of weight 1.
struct SkinnedMesh {
  Mesh mesh;
  std::vector<SkinNode> nodes;  // parents first
  std::vector<SkinJoint> joints;
  Eigen::SparseMatrix<double, Eigen::RowMajor> weights;  // vertices x joints; each row adds up to 1
  std::vector<SkinAnimation> animations;
};

/// Throws InvalidInput, naming `source` and the place in the mesh, unless all of it is finite and
/// as said above.
void validate(const SkinnedMesh& mesh, const std::string& source);

/// One transform per node.
using SkinPose = std::vector<NodeTransform>;

SkinPose rest_pose(const std::vector<SkinNode>& nodes);

/// Nodes that the animation leaves alone are at rest. Rotations are interpolated on the shorter arc
/// (linear), or as vectors made unit again (cubic spline).
SkinPose animated_pose(const std::vector<SkinNode>& nodes, const SkinAnimation& animation,
                       double time_s);

/// World from each node.
std::vector<Eigen::Affine3d> world_from_nodes(const std::vector<SkinNode>& nodes,
                                              const SkinPose& pose);

/// Vertices in the world by linear-blend skinning: each is where the weighted mean of its joints'
/// transforms (world_from_node joint_from_mesh) takes it. A row per vertex.
Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> skinned_positions(const SkinnedMesh& mesh,
                                                                            const SkinPose& pose);

/// Without the seams of textures and normals: vertices that have the same place and weights, and so
/// move alike, become one. Triangles that this leaves without area go, and so do uvs.
SkinnedMesh without_seams(const SkinnedMesh& mesh);

}  // namespace semblance
