#include "semblance/io/gltf_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "gltf_accessor.h"
#include "semblance/core/errors.h"
#include "semblance/io/json_file.h"
#include "semblance/io/text.h"

namespace semblance {
namespace {

namespace fs = std::filesystem;
using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr std::size_t largest_file = std::size_t{1} << 30;

// ---- from bytes to the parser's model

bool is_binary(std::string_view content) { return content.substr(0, 4) == "glTF"; }

/// The JSON of either form. The parser behind recurses, so its input is checked first.
std::string_view json_part(std::string_view content, const std::string& source) {
  if (!is_binary(content)) return content;
  constexpr std::size_t header_bytes = 20;
  std::uint32_t length = 0;
  if (content.size() >= header_bytes) std::memcpy(&length, content.data() + 12, 4);
  if (content.size() < header_bytes || length > content.size() - header_bytes) {
    fail_gltf(source, "the file ends too early; copy it again");
  }
  return content.substr(header_bytes, length);
}

/// Files that a .gltf names are read only from its own folder, and up to the limit in all.
struct Siblings {
  fs::path folder;
  std::uintmax_t bytes_left = largest_file;
};

bool read_sibling(std::vector<unsigned char>* out, std::string* message, const std::string& path,
                  void* user_data) {
  auto& siblings = *static_cast<Siblings*>(user_data);
  std::error_code error;
  const fs::path wanted = fs::weakly_canonical(path, error).parent_path();
  const bool is_sibling = !error && wanted == siblings.folder;
  const std::uintmax_t size = is_sibling ? fs::file_size(path, error) : 0;
  if (!is_sibling || error || size > siblings.bytes_left) {
    *message += "file " + path + " is not beside the .gltf file or too large";
    return false;
  }
  siblings.bytes_left -= size;
  std::ifstream stream(path, std::ios::binary);
  out->resize(size);
  stream.read(reinterpret_cast<char*>(out->data()), static_cast<std::streamsize>(size));
  return static_cast<bool>(stream);
}

tinygltf::FsCallbacks sibling_files(Siblings& siblings) {
  tinygltf::FsCallbacks callbacks{};
  callbacks.FileExists = [](const std::string& path, void*) {
    std::error_code error;
    return fs::is_regular_file(path, error);
  };
  callbacks.ExpandFilePath = [](const std::string& path, void*) { return path; };
  callbacks.ReadWholeFile = read_sibling;
  callbacks.WriteWholeFile = [](std::string*, const std::string&, const std::vector<unsigned char>&,
                                void*) { return false; };
  callbacks.user_data = &siblings;
  return callbacks;
}

tinygltf::Model parse_model(std::string_view content, const std::string& source) {
  parse_json(json_part(content, source), source);
  tinygltf::TinyGLTF loader;
  // Pictures are not needed: leave them undecoded.
  loader.SetImageLoader([](tinygltf::Image*, const int, std::string*, std::string*, int, int,
                           const unsigned char*, int, void*) { return true; },
                        nullptr);
  Siblings siblings{fs::weakly_canonical(source).parent_path()};
  loader.SetFsCallbacks(sibling_files(siblings));
  tinygltf::Model model;
  std::string error, warning;
  const auto size = static_cast<unsigned int>(content.size());
  const std::string folder = siblings.folder.string();
  bool loaded = false;
  try {
    loaded =
        is_binary(content)
            ? loader.LoadBinaryFromMemory(&model, &error, &warning,
                                          reinterpret_cast<const unsigned char*>(content.data()),
                                          size, folder)
            : loader.LoadASCIIFromString(&model, &error, &warning, content.data(), size, folder);
  } catch (const std::exception& exception) {
    error = exception.what();
  }
  if (!loaded) {
    std::replace(error.begin(), error.end(), '\n', ' ');
    fail_gltf(source, "is not a glTF 2.0 file that can be read: " + error);
  }
  return model;
}

void check_extensions(const tinygltf::Model& model, const std::string& source) {
  for (const std::string& name : model.extensionsRequired) {
    if (name.find("compression") == std::string::npos) continue;
    fail_gltf(source, fmt::format("its meshes are compressed ({}); export it without compression",
                                  text::quoted(name)));
  }
}

// ---- nodes

Vector3d vector_of(const std::vector<double>& values, const Vector3d& instead) {
  return values.empty() ? instead : Vector3d(values[0], values[1], values[2]);
}

/// Of a matrix without shear, which the specification asks for (3.5.3).
NodeTransform decomposed(const Eigen::Matrix4d& matrix, const std::string& what,
                         const std::string& source) {
  NodeTransform transform;
  transform.translation_m = matrix.topRightCorner<3, 1>();
  const Eigen::Matrix3d linear = matrix.topLeftCorner<3, 3>();
  transform.scale = linear.colwise().norm();
  if (linear.determinant() < 0.0) transform.scale = -transform.scale;
  if (transform.scale.cwiseAbs().minCoeff() > 0.0) {
    transform.rotation = Quaterniond(linear * transform.scale.cwiseInverse().asDiagonal());
    transform.rotation.normalize();
  }
  const Eigen::Matrix4d error = transform.parent_from_node().matrix() - matrix;
  if (!(error.cwiseAbs().maxCoeff() <= 1e-4 * linear.cwiseAbs().maxCoeff())) {
    fail_gltf(source, what + ": its matrix is not a scale, a rotation and a translation");
  }
  return transform;
}

NodeTransform rest_of(const tinygltf::Node& node, const std::string& what,
                      const std::string& source) {
  const auto has = [](const std::vector<double>& values, std::size_t count) {
    return values.empty() || values.size() == count;
  };
  if (!has(node.matrix, 16) || !has(node.translation, 3) || !has(node.rotation, 4) ||
      !has(node.scale, 3)) {
    fail_gltf(source, what +
                          ": a matrix of 16 numbers, a translation of 3, a rotation of 4 or a "
                          "scale of 3 was expected");
  }
  if (!node.matrix.empty()) {
    return decomposed(Eigen::Map<const Eigen::Matrix4d>(node.matrix.data()), what, source);
  }
  NodeTransform transform;
  transform.translation_m = vector_of(node.translation, Vector3d::Zero());
  transform.scale = vector_of(node.scale, Vector3d::Ones());
  if (!node.rotation.empty()) {
    const auto& q = node.rotation;
    transform.rotation = Quaterniond(q[3], q[0], q[1], q[2]);
    const double norm = transform.rotation.norm();
    if (!(norm > 1e-6 && norm < 1e6)) {
      fail_gltf(source, what + ": its rotation is not a unit quaternion");
    }
    transform.rotation.normalize();
  }
  return transform;
}

/// Parents of all nodes in the file's numbers, -1 for none.
std::vector<int> parents(const tinygltf::Model& model, const std::string& source) {
  std::vector<int> parent(model.nodes.size(), -1);
  for (std::size_t i = 0; i < model.nodes.size(); ++i) {
    for (const int child : model.nodes[i].children) {
      gltf_item(model.nodes, child, "child of a node", source);
      if (parent[child] >= 0) {
        fail_gltf(source,
                  fmt::format("node {} is the child of two nodes; one was expected", child));
      }
      parent[child] = static_cast<int>(i);
    }
  }
  return parent;
}

/// The file's numbers, parents first.
std::vector<int> parents_first(const tinygltf::Model& model, const std::vector<int>& parent,
                               const std::string& source) {
  std::vector<int> order;
  for (std::size_t i = 0; i < parent.size(); ++i) {
    if (parent[i] < 0) order.push_back(static_cast<int>(i));
  }
  for (std::size_t done = 0; done < order.size(); ++done) {
    const std::vector<int>& children = model.nodes[order[done]].children;
    order.insert(order.end(), children.begin(), children.end());
  }
  if (order.size() != parent.size()) {
    fail_gltf(source, "some nodes are their own ancestors; a tree was expected");
  }
  return order;
}

/// Nodes of the default scene, else of the first; all where there is no scene.
std::vector<bool> shown_nodes(const tinygltf::Model& model, const std::vector<int>& order,
                              const std::string& source) {
  std::vector<bool> shown(model.nodes.size(), model.scenes.empty());
  if (model.scenes.empty()) return shown;
  const int number = std::max(model.defaultScene, 0);
  for (const int root : gltf_item(model.scenes, number, "scene", source).nodes) {
    gltf_item(model.nodes, root, "node of a scene", source);
    shown[root] = true;
  }
  for (const int node : order) {
    for (const int child : model.nodes[node].children) shown[child] = shown[child] || shown[node];
  }
  return shown;
}

// ---- meshes

int attribute(const std::map<std::string, int>& attributes, const std::string& name) {
  const auto found = attributes.find(name);
  return found == attributes.end() ? -1 : found->second;
}

void append(const GltfValues& values, std::vector<float>& out) {
  out.insert(out.end(), values.data(), values.data() + values.size());
}

std::string shape_name(const tinygltf::Mesh& mesh, std::size_t index) {
  const tinygltf::Value& names =
      mesh.extras.IsObject() ? mesh.extras.Get("targetNames") : tinygltf::Value();
  if (names.IsArray() && index < names.ArrayLen()) {
    const tinygltf::Value& name = names.Get(static_cast<int>(index));
    if (name.IsString() && !name.Get<std::string>().empty()) return name.Get<std::string>();
  }
  return fmt::format("shape_{:03}", index);
}

// ---- animations

Interpolation interpolation_of(const std::string& name, const std::string& where) {
  if (name.empty() || name == "LINEAR") return Interpolation::linear;
  if (name == "STEP") return Interpolation::step;
  if (name == "CUBICSPLINE") return Interpolation::cubic_spline;
  fail_gltf(where, "LINEAR, STEP or CUBICSPLINE expected, found " + text::quoted(name));
}

bool property_of(const std::string& path, NodeProperty& property) {
  if (path == "translation") {
    property = NodeProperty::translation;
  } else if (path == "rotation") {
    property = NodeProperty::rotation;
  } else if (path == "scale") {
    property = NodeProperty::scale;
  } else {
    return false;
  }
  return true;
}

}  // namespace

struct GltfFile::Impl {
  Impl(std::string_view content, std::string name)
      : source(std::move(name)), model(parse_model(content, source)), reader(model, source) {
    check_extensions(model, source);
    read_nodes();
  }

  void read_nodes();
  void add_triangles(const tinygltf::Primitive& primitive, Eigen::Index vertex_count,
                     int first_vertex, std::vector<int>& triangles);
  void add_weights(const tinygltf::Primitive& primitive, int joint_count, int first_vertex,
                   std::vector<Eigen::Triplet<double>>& weights);
  const tinygltf::Mesh& mesh(int index) const {
    return gltf_item(model.meshes, index, "mesh", source);
  }
  Eigen::Index vertex_count(const tinygltf::Primitive& primitive) const {
    return reader.row_count(attribute(primitive.attributes, "POSITION"), "vertex positions");
  }
  AnimationChannel channel(const tinygltf::AnimationChannel& from,
                           const tinygltf::AnimationSampler& sampler, NodeProperty property,
                           const std::string& where);

  std::string source;
  tinygltf::Model model;
  GltfAccessorReader reader;
  std::vector<SkinNode> nodes;
  std::vector<GltfInstance> instances;
  std::vector<int> number;  // in `nodes` of each node of the file
};

void GltfFile::Impl::read_nodes() {
  const std::vector<int> parent = parents(model, source);
  const std::vector<int> order = parents_first(model, parent, source);
  const std::vector<bool> shown = shown_nodes(model, order, source);
  number.assign(order.size(), -1);
  for (const int i : order) {
    number[i] = static_cast<int>(nodes.size());
    const tinygltf::Node& node = model.nodes[i];
    nodes.push_back(
        {node.name, parent[i] < 0 ? -1 : number[parent[i]],
         rest_of(node, fmt::format("node {} ({})", i, text::quoted(node.name)), source)});
  }
  for (std::size_t i = 0; i < order.size(); ++i) {
    const tinygltf::Node& node = model.nodes[i];
    if (node.mesh < 0) continue;
    mesh(node.mesh);
    instances.push_back({number[i], node.mesh, std::max(node.skin, -1), shown[i]});
  }
}

GltfFile::GltfFile(std::string_view content, const std::string& source)
    : impl_(std::make_unique<Impl>(content, source)) {}

GltfFile::~GltfFile() = default;

const std::vector<SkinNode>& GltfFile::nodes() const { return impl_->nodes; }

const std::vector<GltfInstance>& GltfFile::instances() const { return impl_->instances; }

int GltfFile::mesh_count() const { return static_cast<int>(impl_->model.meshes.size()); }

int GltfFile::shape_count(int mesh) const {
  const auto& primitives = impl_->mesh(mesh).primitives;
  return primitives.empty() ? 0 : static_cast<int>(primitives[0].targets.size());
}

void GltfFile::Impl::add_triangles(const tinygltf::Primitive& primitive, Eigen::Index vertex_count,
                                   int first_vertex, std::vector<int>& triangles) {
  std::vector<int> indices;
  if (primitive.indices >= 0) {
    indices = reader.read_indices(primitive.indices, vertex_count);
  } else {
    for (int i = 0; i < vertex_count; ++i) indices.push_back(i);
  }
  if (indices.size() % 3 != 0)
    fail_gltf(source, "the number of indices is not a multiple of three");
  for (std::size_t i = 0; i + 2 < indices.size(); i += 3) {
    const int a = indices[i], b = indices[i + 1], c = indices[i + 2];
    if (a == b || b == c || c == a) continue;
    for (const int corner : {a, b, c}) triangles.push_back(first_vertex + corner);
  }
}

Mesh GltfFile::mesh(int index) const {
  std::vector<float> positions, uvs;
  std::vector<int> triangles;
  bool has_uvs = true;
  for (const tinygltf::Primitive& primitive : impl_->mesh(index).primitives) {
    if (primitive.mode != TINYGLTF_MODE_TRIANGLES && primitive.mode != -1) {
      fail_gltf(impl_->source, "only meshes of separate triangles can be read");
    }
    const int first_vertex = static_cast<int>(positions.size() / 3);
    const GltfValues points =
        impl_->reader.read(attribute(primitive.attributes, "POSITION"), 3, "vertex positions");
    append(points, positions);
    impl_->add_triangles(primitive, points.rows(), first_vertex, triangles);
    const int uv_index = attribute(primitive.attributes, "TEXCOORD_0");
    has_uvs &= uv_index >= 0;
    if (!has_uvs) continue;
    GltfValues values = impl_->reader.read(uv_index, 2, "texture coordinates");
    if (values.rows() != points.rows()) {
      fail_gltf(impl_->source, "texture coordinates do not match the vertices");
    }
    values.col(1) = 1.0f - values.col(1).array();  // glTF's v runs down
    append(values, uvs);
  }
  Mesh mesh;
  const auto count = static_cast<Eigen::Index>(positions.size() / 3);
  mesh.positions_m = Eigen::Map<const PointsF>(positions.data(), count, 3).cast<double>();
  mesh.triangles.resize(static_cast<Eigen::Index>(triangles.size() / 3), 3);
  std::copy(triangles.begin(), triangles.end(), mesh.triangles.data());
  if (has_uvs) {
    mesh.uvs.resize(count, 2);
    std::copy(uvs.begin(), uvs.end(), mesh.uvs.data());
  }
  return mesh;
}

std::vector<GltfShape> GltfFile::shapes(int mesh) const {
  const tinygltf::Mesh& from = impl_->mesh(mesh);
  const auto count = static_cast<std::size_t>(shape_count(mesh));
  std::vector<std::vector<float>> displacements(count);
  for (const tinygltf::Primitive& primitive : from.primitives) {
    if (primitive.targets.size() != count) {
      fail_gltf(impl_->source,
                "all primitives of a mesh must have the same number of morph targets");
    }
    const Eigen::Index rows = impl_->vertex_count(primitive);
    for (std::size_t i = 0; i < count; ++i) {
      const int index = attribute(primitive.targets[i], "POSITION");
      if (index < 0) {
        impl_->reader.spend(static_cast<std::size_t>(rows), 3);
        displacements[i].resize(displacements[i].size() + 3 * static_cast<std::size_t>(rows));
        continue;
      }
      const GltfValues moved = impl_->reader.read(index, 3, "morph target");
      if (moved.rows() != rows) {
        fail_gltf(impl_->source, fmt::format("morph target {} has {} rows for {} vertices", i,
                                             moved.rows(), rows));
      }
      append(moved, displacements[i]);
    }
  }
  std::vector<GltfShape> shapes;
  for (std::size_t i = 0; i < count; ++i) {
    const auto rows = static_cast<Eigen::Index>(displacements[i].size() / 3);
    shapes.push_back(
        {shape_name(from, i), Eigen::Map<const PointsF>(displacements[i].data(), rows, 3)});
  }
  return shapes;
}

void GltfFile::Impl::add_weights(const tinygltf::Primitive& primitive, int joint_count,
                                 int first_vertex, std::vector<Eigen::Triplet<double>>& weights) {
  const Eigen::Index rows = vertex_count(primitive);
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(rows);
  const std::size_t first = weights.size();
  for (int set = 0;; ++set) {
    const int of_joints = attribute(primitive.attributes, fmt::format("JOINTS_{}", set));
    const int of_weights = attribute(primitive.attributes, fmt::format("WEIGHTS_{}", set));
    if (set > 0 && of_joints < 0 && of_weights < 0) break;
    const GltfValues joints = reader.read(of_joints, 4, "joints of vertices (JOINTS)");
    const GltfValues some = reader.read(of_weights, 4, "weights of vertices (WEIGHTS)");
    if (joints.rows() != rows || some.rows() != rows) {
      fail_gltf(source, fmt::format("{} rows of joints and {} of weights for {} vertices",
                                    joints.rows(), some.rows(), rows));
    }
    for (Eigen::Index v = 0; v < rows; ++v) {
      for (int k = 0; k < 4; ++k) {
        if (some(v, k) == 0.0f) continue;
        if (!(some(v, k) > 0.0f) || !(joints(v, k) >= 0.0f && joints(v, k) < joint_count)) {
          fail_gltf(source, fmt::format("vertex {} has weight {} of joint {}: positive weights of "
                                        "joints 0 to {} expected",
                                        v, some(v, k), joints(v, k), joint_count - 1));
        }
        sum[v] += some(v, k);
        weights.emplace_back(first_vertex + static_cast<int>(v), static_cast<int>(joints(v, k)),
                             some(v, k));
      }
    }
  }
  for (Eigen::Index v = 0; v < rows; ++v) {
    if (!(sum[v] > 0.0)) {
      fail_gltf(source, fmt::format("no joint has a weight of vertex {}; bind it to one", v));
    }
  }
  for (std::size_t i = first; i < weights.size(); ++i) {
    const auto& entry = weights[i];
    weights[i] = {entry.row(), entry.col(), entry.value() / sum[entry.row() - first_vertex]};
  }
}

Eigen::SparseMatrix<double, Eigen::RowMajor> GltfFile::weights(int mesh, int joint_count) const {
  std::vector<Eigen::Triplet<double>> entries;
  Eigen::Index count = 0;
  for (const tinygltf::Primitive& primitive : impl_->mesh(mesh).primitives) {
    impl_->add_weights(primitive, joint_count, static_cast<int>(count), entries);
    count += impl_->vertex_count(primitive);
  }
  Eigen::SparseMatrix<double, Eigen::RowMajor> weights(count, joint_count);
  weights.setFromTriplets(entries.begin(), entries.end());
  return weights;
}

std::vector<SkinJoint> GltfFile::joints(int skin) const {
  const tinygltf::Skin& from = gltf_item(impl_->model.skins, skin, "skin", impl_->source);
  impl_->reader.spend(from.joints.size(), 16);
  std::vector<SkinJoint> joints;
  for (const int node : from.joints) {
    joints.push_back({gltf_item(impl_->number, node, "joint of a skin", impl_->source), {}});
    joints.back().joint_from_mesh.setIdentity();
  }
  if (joints.empty()) fail_gltf(impl_->source, fmt::format("skin {} has no joints", skin));
  if (from.inverseBindMatrices < 0) return joints;
  const GltfValues matrices =
      impl_->reader.read(from.inverseBindMatrices, 16, "inverse bind matrices");
  if (matrices.rows() < static_cast<Eigen::Index>(joints.size())) {
    fail_gltf(impl_->source, fmt::format("{} inverse bind matrices for {} joints", matrices.rows(),
                                         joints.size()));
  }
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const Eigen::Matrix4f matrix =
        Eigen::Map<const Eigen::Matrix4f>(matrices.row(static_cast<Eigen::Index>(j)).data());
    if (!matrix.row(3).isApprox(Eigen::RowVector4f(0.0f, 0.0f, 0.0f, 1.0f), 1e-4f)) {
      fail_gltf(impl_->source,
                fmt::format("the last row of inverse bind matrix {} is not (0, 0, 0, 1)", j));
    }
    joints[j].joint_from_mesh.affine() = matrix.topRows<3>().cast<double>();
  }
  return joints;
}

AnimationChannel GltfFile::Impl::channel(const tinygltf::AnimationChannel& from,
                                         const tinygltf::AnimationSampler& sampler,
                                         NodeProperty property, const std::string& where) {
  AnimationChannel channel;
  channel.node = gltf_item(number, from.target_node, "node of a channel", where);
  channel.property = property;
  channel.interpolation = interpolation_of(sampler.interpolation, where);
  const GltfValues times = reader.read(sampler.input, 1, "times of an animation");
  channel.times_s.assign(times.data(), times.data() + times.size());
  const int width = property == NodeProperty::rotation ? 4 : 3;
  channel.values = reader.read(sampler.output, width, "values of an animation").cast<double>();
  return channel;
}

std::vector<SkinAnimation> GltfFile::animations() const {
  std::vector<SkinAnimation> animations;
  for (const tinygltf::Animation& from : impl_->model.animations) {
    const std::string where = impl_->source + ": animation " + text::quoted(from.name);
    SkinAnimation animation{from.name, {}};
    for (const tinygltf::AnimationChannel& channel : from.channels) {
      NodeProperty property;
      if (!property_of(channel.target_path, property)) continue;
      const auto& sampler =
          gltf_item(from.samplers, channel.sampler, "sampler of a channel", where);
      animation.channels.push_back(impl_->channel(channel, sampler, property, where));
    }
    animations.push_back(std::move(animation));
  }
  return animations;
}

GltfFile read_gltf(const std::string& path) {
  return GltfFile(text::read_file(path, largest_file), path);
}

}  // namespace semblance
