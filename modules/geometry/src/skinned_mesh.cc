#include "semblance/geometry/skinned_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

using Eigen::Affine3d;
using Eigen::Quaterniond;
using Eigen::RowVectorXd;
using Eigen::Vector3d;
using Weights = decltype(SkinnedMesh::weights);

[[noreturn]] void fail(const std::string& source, const std::string& what) {
  throw InvalidInput(fmt::format("{}: {}", source, what));
}

// ---- what a mesh must satisfy

void check_nodes(const SkinnedMesh& mesh, const std::string& source) {
  for (std::size_t i = 0; i < mesh.nodes.size(); ++i) {
    const SkinNode& node = mesh.nodes[i];
    if (node.parent < -1 || node.parent >= static_cast<int>(i)) {
      fail(source, fmt::format("node {} ('{}') does not follow its parent", i, node.name));
    }
    if (!node.rest.translation_m.allFinite() || !node.rest.scale.allFinite() ||
        !(std::abs(node.rest.rotation.norm() - 1.0) < 1e-6)) {
      fail(source, fmt::format("the transform of node {} ('{}') is not finite, or its rotation no "
                               "unit quaternion",
                               i, node.name));
    }
  }
}

void check_joints(const SkinnedMesh& mesh, const std::string& source) {
  for (std::size_t j = 0; j < mesh.joints.size(); ++j) {
    const SkinJoint& joint = mesh.joints[j];
    if (joint.node < 0 || joint.node >= static_cast<int>(mesh.nodes.size())) {
      fail(source, fmt::format("joint {} is node {}, which does not exist", j, joint.node));
    }
    if (!joint.joint_from_mesh.matrix().allFinite()) {
      fail(source, fmt::format("the inverse bind matrix of joint {} is not finite", j));
    }
  }
}

void check_weights(const SkinnedMesh& mesh, const std::string& source) {
  if (mesh.weights.rows() != mesh.mesh.vertex_count() ||
      mesh.weights.cols() != static_cast<Eigen::Index>(mesh.joints.size())) {
    fail(source, "weights: a row per vertex and a column per joint were expected");
  }
  for (Eigen::Index v = 0; v < mesh.weights.rows(); ++v) {
    double sum = 0.0;
    bool usable = true;
    for (Weights::InnerIterator it(mesh.weights, v); it; ++it) {
      usable &= it.value() >= 0.0;
      sum += it.value();
    }
    if (!usable || !(std::abs(sum - 1.0) < 1e-6)) {
      fail(source, fmt::format("the weights of vertex {} are negative or do not add up to 1", v));
    }
  }
}

void check_channel(const AnimationChannel& channel, const SkinnedMesh& mesh,
                   const std::string& source) {
  if (channel.node < 0 || channel.node >= static_cast<int>(mesh.nodes.size())) {
    fail(source, fmt::format("moves node {}, which does not exist", channel.node));
  }
  const bool is_rotation = channel.property == NodeProperty::rotation;
  const int rows_per_key = channel.interpolation == Interpolation::cubic_spline ? 3 : 1;
  const auto keys = static_cast<Eigen::Index>(channel.times_s.size());
  if (keys == 0 || channel.values.rows() != rows_per_key * keys ||
      channel.values.cols() != (is_rotation ? 4 : 3)) {
    fail(source, fmt::format("{} rows of {} numbers for {} keys: {} per key, of {} numbers, "
                             "expected",
                             channel.values.rows(), channel.values.cols(), keys, rows_per_key,
                             is_rotation ? 4 : 3));
  }
  for (Eigen::Index k = 0; k < keys; ++k) {
    if (!std::isfinite(channel.times_s[k]) ||
        (k > 0 && !(channel.times_s[k] > channel.times_s[k - 1]))) {
      fail(source, fmt::format("key {} is at {} s: times must ascend", k, channel.times_s[k]));
    }
  }
  if (!channel.values.allFinite()) fail(source, "a value is not finite");
  for (Eigen::Index k = 0; is_rotation && k < keys; ++k) {
    if (!(channel.values.row(rows_per_key * k + rows_per_key / 2).norm() > 1e-6)) {
      fail(source, fmt::format("the rotation of key {} is zero: unit quaternions expected", k));
    }
  }
}

// ---- interpolation, as in appendix C of the specification

struct Keys {
  std::size_t before, after;
  double fraction, interval_s;
};

Keys keys_around(const std::vector<double>& times_s, double time_s) {
  const auto next = std::upper_bound(times_s.begin(), times_s.end(), time_s);
  if (next == times_s.begin()) return {0, 0, 0.0, 0.0};
  const auto after = static_cast<std::size_t>(next - times_s.begin());
  if (next == times_s.end()) return {after - 1, after - 1, 0.0, 0.0};
  const double interval_s = next[0] - next[-1];
  return {after - 1, after, (time_s - next[-1]) / interval_s, interval_s};
}

Quaterniond rotation_of(const RowVectorXd& xyzw) {
  return Quaterniond(xyzw[3], xyzw[0], xyzw[1], xyzw[2]).normalized();
}

RowVectorXd linear(const AnimationChannel& channel, const Keys& keys) {
  const RowVectorXd before = channel.values.row(static_cast<Eigen::Index>(keys.before));
  const RowVectorXd after = channel.values.row(static_cast<Eigen::Index>(keys.after));
  if (channel.property != NodeProperty::rotation) {
    return (1.0 - keys.fraction) * before + keys.fraction * after;
  }
  return rotation_of(before).slerp(keys.fraction, rotation_of(after)).coeffs().transpose();
}

RowVectorXd cubic_spline(const AnimationChannel& channel, const Keys& keys) {
  const auto row = [&](std::size_t key, int part) {
    return channel.values.row(static_cast<Eigen::Index>(3 * key) + part);
  };
  const double t = keys.fraction, t2 = t * t, t3 = t2 * t;
  return (2.0 * t3 - 3.0 * t2 + 1.0) * row(keys.before, 1) +
         keys.interval_s * (t3 - 2.0 * t2 + t) * row(keys.before, 2) +
         (-2.0 * t3 + 3.0 * t2) * row(keys.after, 1) +
         keys.interval_s * (t3 - t2) * row(keys.after, 0);
}

RowVectorXd value_at(const AnimationChannel& channel, double time_s) {
  const Keys keys = keys_around(channel.times_s, time_s);
  switch (channel.interpolation) {
    case Interpolation::step:
      return channel.values.row(static_cast<Eigen::Index>(keys.before));
    case Interpolation::linear:
      return linear(channel, keys);
    default:
      return cubic_spline(channel, keys);
  }
}

// ---- seams

/// What tells vertices apart that do not always move alike.
std::vector<double> place_and_weights(const SkinnedMesh& mesh, Eigen::Index vertex) {
  const auto place = mesh.mesh.positions_m.row(vertex);
  std::vector<double> key(place.begin(), place.end());
  for (Weights::InnerIterator it(mesh.weights, vertex); it; ++it) {
    key.push_back(static_cast<double>(it.col()));
    key.push_back(it.value());
  }
  return key;
}

Weights rows_of(const Weights& weights, const std::vector<int>& rows) {
  std::vector<Eigen::Triplet<double>> ones;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    ones.emplace_back(static_cast<int>(i), rows[i], 1.0);
  }
  Weights selection(static_cast<Eigen::Index>(rows.size()), weights.rows());
  selection.setFromTriplets(ones.begin(), ones.end());
  return selection * weights;
}

}  // namespace

Affine3d NodeTransform::parent_from_node() const {
  Affine3d transform;
  transform.linear() = rotation.toRotationMatrix() * scale.asDiagonal();
  transform.translation() = translation_m;
  transform.makeAffine();
  return transform;
}

double SkinAnimation::end_s() const {
  double end_s = 0.0;
  for (const AnimationChannel& channel : channels) {
    if (!channel.times_s.empty()) end_s = std::max(end_s, channel.times_s.back());
  }
  return end_s;
}

void validate(const SkinnedMesh& mesh, const std::string& source) {
  validate(mesh.mesh, source);
  check_nodes(mesh, source);
  check_joints(mesh, source);
  check_weights(mesh, source);
  for (const SkinAnimation& animation : mesh.animations) {
    for (std::size_t c = 0; c < animation.channels.size(); ++c) {
      check_channel(animation.channels[c], mesh,
                    fmt::format("{}: animation '{}', channel {}", source, animation.name, c));
    }
  }
}

SkinPose rest_pose(const std::vector<SkinNode>& nodes) {
  SkinPose pose;
  pose.reserve(nodes.size());
  for (const SkinNode& node : nodes) pose.push_back(node.rest);
  return pose;
}

SkinPose animated_pose(const std::vector<SkinNode>& nodes, const SkinAnimation& animation,
                       double time_s) {
  SkinPose pose = rest_pose(nodes);
  for (const AnimationChannel& channel : animation.channels) {
    const RowVectorXd value = value_at(channel, time_s);
    NodeTransform& node = pose[channel.node];
    switch (channel.property) {
      case NodeProperty::translation:
        node.translation_m = value.transpose();
        break;
      case NodeProperty::rotation:
        node.rotation = rotation_of(value);
        break;
      case NodeProperty::scale:
        node.scale = value.transpose();
        break;
    }
  }
  return pose;
}

std::vector<Affine3d> world_from_nodes(const std::vector<SkinNode>& nodes, const SkinPose& pose) {
  std::vector<Affine3d> world;
  world.reserve(nodes.size());
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const Affine3d parent_from_node = pose[i].parent_from_node();
    const int parent = nodes[i].parent;
    world.push_back(parent < 0 ? parent_from_node : world[parent] * parent_from_node);
  }
  return world;
}

Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> skinned_positions(const SkinnedMesh& mesh,
                                                                            const SkinPose& pose) {
  const std::vector<Affine3d> world = world_from_nodes(mesh.nodes, pose);
  std::vector<Affine3d> world_from_mesh;
  world_from_mesh.reserve(mesh.joints.size());
  for (const SkinJoint& joint : mesh.joints) {
    world_from_mesh.push_back(world[joint.node] * joint.joint_from_mesh);
  }
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> positions_m(mesh.mesh.vertex_count(),
                                                                        3);
  for (Eigen::Index v = 0; v < positions_m.rows(); ++v) {
    Vector3d position = Vector3d::Zero();
    const Vector3d bound = mesh.mesh.positions_m.row(v);
    for (Weights::InnerIterator it(mesh.weights, v); it; ++it) {
      position += it.value() * (world_from_mesh[it.col()] * bound);
    }
    positions_m.row(v) = position;
  }
  return positions_m;
}

SkinnedMesh without_seams(const SkinnedMesh& mesh) {
  std::map<std::vector<double>, int> number_of;
  std::vector<int> number, kept;
  for (Eigen::Index v = 0; v < mesh.mesh.vertex_count(); ++v) {
    const auto [found, is_new] =
        number_of.try_emplace(place_and_weights(mesh, v), static_cast<int>(kept.size()));
    if (is_new) kept.push_back(static_cast<int>(v));
    number.push_back(found->second);
  }
  SkinnedMesh result = mesh;
  result.mesh.uvs.resize(0, 2);
  result.mesh.positions_m = mesh.mesh.positions_m(kept, Eigen::all);
  result.weights = rows_of(mesh.weights, kept);
  Eigen::Index count = 0;
  for (Eigen::Index t = 0; t < mesh.mesh.triangle_count(); ++t) {
    const auto corners = mesh.mesh.triangles.row(t);
    const int a = number[corners[0]], b = number[corners[1]], c = number[corners[2]];
    if (a != b && b != c && c != a) result.mesh.triangles.row(count++) << a, b, c;
  }
  result.mesh.triangles.conservativeResize(count, 3);
  return result;
}

}  // namespace semblance
