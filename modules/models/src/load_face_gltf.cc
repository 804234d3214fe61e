// A mesh with morph targets from glTF 2.0, text or binary.
#include <fmt/format.h>
#include <tiny_gltf.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "load_face_parts.h"
#include "semblance/core/errors.h"
#include "semblance/io/json_file.h"

namespace semblance::load {
namespace {

namespace fs = std::filesystem;
using Values = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr std::size_t largest_file = std::size_t{1} << 30;

[[noreturn]] void fail(const std::string& source, const std::string& what) {
  throw InvalidInput(fmt::format("{}: {}", source, what));
}

std::string read_bytes(const std::string& path) {
  std::error_code error;
  const std::uintmax_t size = fs::file_size(path, error);
  std::ifstream stream(path, std::ios::binary);
  if (error || !stream) throw IoError(path + ": cannot be opened");
  if (size > largest_file) fail(path, "is larger than 1 GiB, the most that is read of such a file");
  std::string content(size, '\0');
  stream.read(content.data(), static_cast<std::streamsize>(size));
  if (!stream) throw IoError(path + ": reading failed");
  return content;
}

bool is_binary(std::string_view content) { return content.substr(0, 4) == "glTF"; }

/// The JSON of either form. The parser behind recurses, so its input is checked first.
std::string_view json_part(std::string_view content, const std::string& source) {
  if (!is_binary(content)) return content;
  constexpr std::size_t header_bytes = 20;
  std::uint32_t length = 0;
  if (content.size() >= header_bytes) std::memcpy(&length, content.data() + 12, 4);
  if (content.size() < header_bytes || length > content.size() - header_bytes) {
    fail(source, "the file ends too early; copy it again");
  }
  return content.substr(header_bytes, length);
}

/// Files that a .gltf names are read only from its own folder, and only up to the limit.
tinygltf::FsCallbacks sibling_files() {
  tinygltf::FsCallbacks callbacks{};
  callbacks.FileExists = [](const std::string& path, void*) {
    std::error_code error;
    return fs::is_regular_file(path, error);
  };
  callbacks.ExpandFilePath = [](const std::string& path, void*) { return path; };
  callbacks.ReadWholeFile = [](std::vector<unsigned char>* out, std::string* message,
                               const std::string& path, void* folder) {
    std::error_code error;
    const fs::path wanted = fs::weakly_canonical(path, error).parent_path();
    const bool is_sibling = !error && wanted == *static_cast<const fs::path*>(folder);
    const std::uintmax_t size = is_sibling ? fs::file_size(path, error) : 0;
    if (!is_sibling || error || size > largest_file) {
      *message += "file " + path + " is not beside the .gltf file or too large";
      return false;
    }
    std::ifstream stream(path, std::ios::binary);
    out->resize(size);
    stream.read(reinterpret_cast<char*>(out->data()), static_cast<std::streamsize>(size));
    return static_cast<bool>(stream);
  };
  callbacks.WriteWholeFile = [](std::string*, const std::string&, const std::vector<unsigned char>&,
                                void*) { return false; };
  return callbacks;
}

tinygltf::Model parse_model(std::string_view content, const std::string& source) {
  parse_json(json_part(content, source), source);
  tinygltf::TinyGLTF loader;
  // Pictures are not needed: leave them undecoded.
  loader.SetImageLoader([](tinygltf::Image*, const int, std::string*, std::string*, int, int,
                           const unsigned char*, int, void*) { return true; },
                        nullptr);
  fs::path folder = fs::weakly_canonical(source).parent_path();
  tinygltf::FsCallbacks callbacks = sibling_files();
  callbacks.user_data = &folder;
  loader.SetFsCallbacks(callbacks);
  tinygltf::Model model;
  std::string error, warning;
  const auto size = static_cast<unsigned int>(content.size());
  bool loaded = false;
  try {
    loaded = is_binary(content) ? loader.LoadBinaryFromMemory(
                                      &model, &error, &warning,
                                      reinterpret_cast<const unsigned char*>(content.data()), size,
                                      folder.string())
                                : loader.LoadASCIIFromString(&model, &error, &warning,
                                                             content.data(), size, folder.string());
  } catch (const std::exception& exception) {
    error = exception.what();
  }
  if (!loaded) {
    std::replace(error.begin(), error.end(), '\n', ' ');
    fail(source, "is not a glTF 2.0 file that can be read: " + error);
  }
  return model;
}

/// Reads accessors; every index and range in the file is checked before it is used.
class AccessorReader {
 public:
  AccessorReader(const tinygltf::Model& model, const std::string& source)
      : model_(model), source_(source) {}

  /// The accessor's rows of `width` numbers as floats (normalised integers become 0 to 1).
  Values read(int index, int width, const char* what) const {
    const tinygltf::Accessor& accessor = item(model_.accessors, index, what);
    constexpr std::size_t most_rows = 20'000'000;
    if (accessor.count == 0 || accessor.count > most_rows ||
        tinygltf::GetNumComponentsInType(accessor.type) != width) {
      fail(source_, fmt::format("{}: an accessor with {} components and 1 to {} rows was expected",
                                what, width, most_rows));
    }
    Values values;
    if (accessor.bufferView >= 0) {
      const Span span = find(accessor.bufferView, accessor.byteOffset, accessor.count,
                             accessor.componentType, width, what);
      values.resize(static_cast<Eigen::Index>(accessor.count), width);
      for (std::size_t row = 0; row < accessor.count; ++row) {
        for (int i = 0; i < width; ++i) {
          values(row, i) = static_cast<float>(component(span, row, i, accessor.normalized, what));
        }
      }
    } else {
      // All zero: only worth its memory where a sparse part follows in a mesh of that size.
      values = Values::Zero(static_cast<Eigen::Index>(accessor.count), width);
    }
    if (accessor.sparse.isSparse) read_sparse(accessor, width, what, values);
    if (!values.allFinite()) fail(source_, fmt::format("{}: a value is not finite", what));
    return values;
  }

  std::vector<int> read_indices(int index, Eigen::Index vertex_count) const {
    const tinygltf::Accessor& accessor = item(model_.accessors, index, "indices");
    if (accessor.type != TINYGLTF_TYPE_SCALAR || accessor.sparse.isSparse) {
      fail(source_, "indices: a dense scalar accessor was expected");
    }
    const Span span = find(accessor.bufferView, accessor.byteOffset, accessor.count,
                           accessor.componentType, 1, "indices");
    std::vector<int> indices(accessor.count);
    for (std::size_t row = 0; row < accessor.count; ++row) {
      indices[row] = checked_index(component(span, row, 0, false, "indices"), vertex_count);
    }
    return indices;
  }

 private:
  struct Span {
    const unsigned char* data = nullptr;
    std::size_t stride = 0;
    int component_type = 0, component_size = 0;
  };

  template <typename T>
  const T& item(const std::vector<T>& items, int index, const char* what) const {
    if (index < 0 || index >= static_cast<int>(items.size())) {
      fail(source_, fmt::format("{}: number {} does not exist", what, index));
    }
    return items[static_cast<std::size_t>(index)];
  }

  /// The bytes of `count` rows; throws unless all of them lie in the view and the buffer.
  Span find(int view_index, std::size_t offset, std::size_t count, int component_type, int width,
            const char* what) const {
    const tinygltf::BufferView& view = item(model_.bufferViews, view_index, what);
    const tinygltf::Buffer& buffer = item(model_.buffers, view.buffer, what);
    Span span;
    span.component_type = component_type;
    span.component_size =
        tinygltf::GetComponentSizeInBytes(static_cast<std::uint32_t>(component_type));
    const std::size_t row_bytes =
        span.component_size > 0 ? static_cast<std::size_t>(span.component_size) * width : 0;
    span.stride = view.byteStride == 0 ? row_bytes : view.byteStride;
    const bool fits_buffer = view.byteOffset <= buffer.data.size() &&
                             view.byteLength <= buffer.data.size() - view.byteOffset;
    const bool fits_view = row_bytes > 0 && count > 0 && offset <= view.byteLength &&
                           row_bytes <= view.byteLength - offset && span.stride >= row_bytes &&
                           (view.byteLength - offset - row_bytes) / span.stride >= count - 1;
    if (!fits_buffer || !fits_view) {
      fail(source_, fmt::format("{}: its {} rows do not fit into the file's data", what, count));
    }
    span.data = buffer.data.data() + view.byteOffset + offset;
    return span;
  }

  double component(const Span& span, std::size_t row, int column, bool normalized,
                   const char* what) const {
    const unsigned char* at = span.data + row * span.stride + column * span.component_size;
    const auto load = [at]<typename T>(T value) {
      std::memcpy(&value, at, sizeof(T));
      return value;
    };
    switch (span.component_type) {
      case TINYGLTF_COMPONENT_TYPE_FLOAT:
        return load(float{});
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
        return load(std::uint8_t{}) / (normalized ? 255.0 : 1.0);
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
        return load(std::uint16_t{}) / (normalized ? 65535.0 : 1.0);
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
        return load(std::uint32_t{});
      case TINYGLTF_COMPONENT_TYPE_BYTE:
        return std::max(load(std::int8_t{}) / (normalized ? 127.0 : 1.0),
                        normalized ? -1.0 : -128.0);
      case TINYGLTF_COMPONENT_TYPE_SHORT:
        return std::max(load(std::int16_t{}) / (normalized ? 32767.0 : 1.0),
                        normalized ? -1.0 : -32768.0);
      default:
        fail(source_, fmt::format("{}: component type {} is not known", what, span.component_type));
    }
  }

  int checked_index(double index, Eigen::Index count) const {
    if (!(index >= 0.0 && index < static_cast<double>(count))) {
      fail(source_, fmt::format("vertex {} does not exist; there are {}", index, count));
    }
    return static_cast<int>(index);
  }

  void read_sparse(const tinygltf::Accessor& accessor, int width, const char* what,
                   Values& values) const {
    const auto& sparse = accessor.sparse;
    if (sparse.count <= 0 || static_cast<std::size_t>(sparse.count) > accessor.count ||
        sparse.indices.byteOffset < 0 || sparse.values.byteOffset < 0) {
      fail(source_, fmt::format("{}: its sparse part is damaged", what));
    }
    const auto count = static_cast<std::size_t>(sparse.count);
    const Span indices =
        find(sparse.indices.bufferView, static_cast<std::size_t>(sparse.indices.byteOffset), count,
             sparse.indices.componentType, 1, what);
    const Span rows =
        find(sparse.values.bufferView, static_cast<std::size_t>(sparse.values.byteOffset), count,
             accessor.componentType, width, what);
    for (std::size_t i = 0; i < count; ++i) {
      const int row = checked_index(component(indices, i, 0, false, what), values.rows());
      for (int k = 0; k < width; ++k) {
        values(row, k) = static_cast<float>(component(rows, i, k, accessor.normalized, what));
      }
    }
  }

  const tinygltf::Model& model_;
  const std::string& source_;
};

int attribute(const std::map<std::string, int>& attributes, const char* name) {
  const auto found = attributes.find(name);
  return found == attributes.end() ? -1 : found->second;
}

/// One mesh of the file with its primitives joined.
struct GltfFace {
  MeshFile file;
  std::vector<NamedShape> shapes;
};

/// Primitive by primitive, so that each is short-lived.
class FaceBuilder {
 public:
  FaceBuilder(const tinygltf::Model& model, const tinygltf::Mesh& mesh, const std::string& source)
      : mesh_(mesh),
        source_(source),
        reader_(model, source),
        target_count_(mesh.primitives[0].targets.size()) {
    displacements_.resize(target_count_);
    for (const tinygltf::Primitive& primitive : mesh.primitives) add(primitive);
  }

  GltfFace finish() {
    GltfFace face;
    Mesh& mesh = face.file.mesh;
    const auto count = static_cast<Eigen::Index>(positions_.size() / 3);
    mesh.positions_m = Eigen::Map<const PointsF>(positions_.data(), count, 3).cast<double>();
    mesh.triangles.resize(static_cast<Eigen::Index>(triangles_.size() / 3), 3);
    std::copy(triangles_.begin(), triangles_.end(), mesh.triangles.data());
    if (has_uvs_) {
      mesh.uvs.resize(count, 2);
      std::copy(uvs_.begin(), uvs_.end(), mesh.uvs.data());
    }
    face.file.file_vertex_count = static_cast<int>(count);
    for (int i = 0; i < count; ++i) face.file.file_vertex.push_back(i);
    for (std::size_t i = 0; i < target_count_; ++i) {
      face.shapes.push_back(
          {target_name(i), Eigen::Map<const PointsF>(displacements_[i].data(), count, 3)});
    }
    return face;
  }

 private:
  void add(const tinygltf::Primitive& primitive) {
    if (primitive.mode != TINYGLTF_MODE_TRIANGLES && primitive.mode != -1) {
      fail(source_, "only meshes of separate triangles can be read");
    }
    if (primitive.targets.size() != target_count_) {
      fail(source_, "all primitives of a mesh must have the same number of morph targets");
    }
    const int first_vertex = static_cast<int>(positions_.size() / 3);
    const Values positions =
        reader_.read(attribute(primitive.attributes, "POSITION"), 3, "vertex positions");
    append(positions, positions_);
    add_uvs(primitive, positions.rows());
    add_triangles(primitive, positions.rows(), first_vertex);
    for (std::size_t i = 0; i < target_count_; ++i) {
      const int index = attribute(primitive.targets[i], "POSITION");
      const Values moved = index < 0 ? Values(Values::Zero(positions.rows(), 3))
                                     : reader_.read(index, 3, "morph target");
      if (moved.rows() != positions.rows()) {
        fail(source_, fmt::format("morph target {} has {} rows for {} vertices", i, moved.rows(),
                                  positions.rows()));
      }
      append(moved, displacements_[i]);
    }
  }

  static void append(const Values& values, std::vector<float>& out) {
    out.insert(out.end(), values.data(), values.data() + values.size());
  }

  void add_uvs(const tinygltf::Primitive& primitive, Eigen::Index vertex_count) {
    const int index = attribute(primitive.attributes, "TEXCOORD_0");
    has_uvs_ &= index >= 0;
    if (!has_uvs_) return;
    Values uvs = reader_.read(index, 2, "texture coordinates");
    if (uvs.rows() != vertex_count) fail(source_, "texture coordinates do not match the vertices");
    uvs.col(1) = 1.0f - uvs.col(1).array();  // glTF's v runs down
    append(uvs, uvs_);
  }

  void add_triangles(const tinygltf::Primitive& primitive, Eigen::Index vertex_count,
                     int first_vertex) {
    std::vector<int> indices;
    if (primitive.indices >= 0) {
      indices = reader_.read_indices(primitive.indices, vertex_count);
    } else {
      for (int i = 0; i < vertex_count; ++i) indices.push_back(i);
    }
    if (indices.size() % 3 != 0) fail(source_, "the number of indices is not a multiple of three");
    for (std::size_t i = 0; i + 2 < indices.size(); i += 3) {
      const int a = indices[i], b = indices[i + 1], c = indices[i + 2];
      if (a == b || b == c || c == a) continue;
      for (int corner : {a, b, c}) triangles_.push_back(first_vertex + corner);
    }
  }

  std::string target_name(std::size_t index) const {
    const tinygltf::Value& names =
        mesh_.extras.IsObject() ? mesh_.extras.Get("targetNames") : tinygltf::Value();
    if (names.IsArray() && index < names.ArrayLen()) {
      const tinygltf::Value& name = names.Get(static_cast<int>(index));
      if (name.IsString() && !name.Get<std::string>().empty()) return name.Get<std::string>();
    }
    return fmt::format("shape_{:03}", index);
  }

  const tinygltf::Mesh& mesh_;
  const std::string& source_;
  AccessorReader reader_;
  std::size_t target_count_ = 0;
  bool has_uvs_ = true;
  std::vector<float> positions_, uvs_;
  std::vector<int> triangles_;
  std::vector<std::vector<float>> displacements_;
};

Eigen::Affine3d local_transform(const tinygltf::Node& node) {
  Eigen::Affine3d transform = Eigen::Affine3d::Identity();
  if (node.matrix.size() == 16) {
    transform.matrix() = Eigen::Map<const Eigen::Matrix4d>(node.matrix.data());
    return transform;
  }
  if (node.translation.size() == 3) {
    transform.translate(
        Eigen::Vector3d(node.translation[0], node.translation[1], node.translation[2]));
  }
  if (node.rotation.size() == 4) {
    const auto& q = node.rotation;
    transform.rotate(Eigen::Quaterniond(q[3], q[0], q[1], q[2]).normalized());
  }
  if (node.scale.size() == 3) {
    transform.scale(Eigen::Vector3d(node.scale[0], node.scale[1], node.scale[2]));
  }
  return transform;
}

/// World from mesh: the transforms of the first node with the mesh and of those above it.
Eigen::Affine3d placement(const tinygltf::Model& model, int mesh_index) {
  const int count = static_cast<int>(model.nodes.size());
  std::vector<int> parent(count, -1);
  int node = -1;
  for (int i = count - 1; i >= 0; --i) {
    if (model.nodes[i].mesh == mesh_index) node = i;
    for (int child : model.nodes[i].children) {
      if (child >= 0 && child < count) parent[child] = i;
    }
  }
  Eigen::Affine3d transform = Eigen::Affine3d::Identity();
  // A damaged file may make a ring of nodes; no chain is longer than their number.
  for (int steps = 0; node >= 0 && steps < count; ++steps, node = parent[node]) {
    transform = local_transform(model.nodes[node]) * transform;
  }
  return transform;
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

}  // namespace

MorphShape gltf_face_from_bytes(std::string_view content, const std::string& source,
                                const FaceLoadOptions& options) {
  const tinygltf::Model model = parse_model(content, source);
  // The mesh with most morph targets is the face.
  const auto targets = [](const tinygltf::Mesh& mesh) {
    return mesh.primitives.empty() ? 0 : mesh.primitives[0].targets.size();
  };
  const auto mesh = std::max_element(
      model.meshes.begin(), model.meshes.end(),
      [&](const tinygltf::Mesh& a, const tinygltf::Mesh& b) { return targets(a) < targets(b); });
  constexpr std::size_t most_targets = 4096;
  if (mesh == model.meshes.end() || targets(*mesh) == 0 || targets(*mesh) > most_targets) {
    fail(source, fmt::format("a mesh with 1 to {} morph targets was expected", most_targets));
  }
  GltfFace face = FaceBuilder(model, *mesh, source).finish();
  if (face.file.mesh.triangle_count() == 0) fail(source, "the mesh has no triangle");
  place(placement(model, static_cast<int>(mesh - model.meshes.begin())), source, face);
  const fs::path landmarks = fs::path(source).replace_extension(".landmarks.json");
  return assemble(face.file, std::move(face.shapes), landmarks.string(), source, options);
}

MorphShape gltf_face(const std::string& path, const FaceLoadOptions& options) {
  return gltf_face_from_bytes(read_bytes(path), path, options);
}

}  // namespace semblance::load
