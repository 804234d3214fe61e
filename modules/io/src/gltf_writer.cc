#include "semblance/io/gltf_writer.h"

#include <fmt/format.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>

#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/core/version.h"

namespace semblance {
namespace {

using Json = nlohmann::ordered_json;

// Numbers of the glTF 2.0 specification (Khronos Group 2021), sections 3.6 and 5.
constexpr int component_float = 5126, component_uint32 = 5125;
constexpr int target_array_buffer = 34962, target_element_array_buffer = 34963;
constexpr int filter_linear = 9729, filter_linear_mipmap_linear = 9987, wrap_clamp = 33071;

void check_target(const GltfMorphTarget& target, Eigen::Index vertex_count,
                  const std::string& path) {
  bool usable = target.displacement_m.allFinite() &&
                static_cast<Eigen::Index>(target.vertices.size()) == target.displacement_m.rows();
  int previous = -1;
  for (int vertex : target.vertices) {
    usable &= vertex > previous && vertex < vertex_count;
    previous = vertex;
  }
  if (!usable) {
    throw InvalidInput(
        fmt::format("{}: morph target '{}' needs ascending vertices of the mesh with "
                    "one finite displacement each",
                    path, target.name));
  }
}

void check_key(const GltfKey& key, double previous_s, std::size_t target_count,
               const std::string& path) {
  bool usable = key.time_s > previous_s && std::isfinite(key.time_s) &&
                key.weights.size() == target_count &&
                key.world_from_model.rotation.coeffs().allFinite() &&
                key.world_from_model.translation_m.allFinite();
  for (float weight : key.weights) usable &= std::isfinite(weight);
  if (!usable) {
    throw InvalidInput(
        fmt::format("{}: the animation key at {} s needs a later time than the one "
                    "before, {} finite weights and a finite pose",
                    path, key.time_s, target_count));
  }
}

void check(const GltfScene& scene, const std::string& path) {
  validate(scene.mesh, path);
  if (scene.mesh.triangle_count() == 0) throw InvalidInput(path + ": the mesh has no triangle");
  if (scene.texture && scene.mesh.uvs.rows() == 0) {
    throw InvalidInput(path + ": a texture needs texture coordinates");
  }
  for (const GltfMorphTarget& target : scene.targets) {
    check_target(target, scene.mesh.vertex_count(), path);
  }
  double previous_s = -1.0;
  for (const GltfKey& key : scene.animation) {
    check_key(key, previous_s, scene.targets.size(), path);
    previous_s = key.time_s;
  }
}

/// The binary chunk and the JSON that describes it.
class Document {
 public:
  explicit Document(const GltfScene& scene) : scene_(scene) {
    json_["asset"] = {{"version", "2.0"}, {"generator", program_version()}};
    json_["scene"] = 0;
    json_["scenes"] = {{{"nodes", {0}}}};
    json_["nodes"] = {{{"name", scene.name}, {"mesh", 0}}};
    add_mesh();
    add_material();
    if (!scene.animation.empty()) add_animation();
    while (bytes_.size() % 4 != 0) bytes_.push_back(0);
    json_["buffers"] = {{{"byteLength", bytes_.size()}}};
  }

  /// The container: header, then a JSON chunk and a binary chunk, each padded to four bytes.
  std::string container() const {
    std::string json = json_.dump(-1, ' ', false, Json::error_handler_t::replace);
    json.resize((json.size() + 3) / 4 * 4, ' ');
    const std::size_t size = 12 + 8 + json.size() + 8 + bytes_.size();
    if (size > std::numeric_limits<std::uint32_t>::max()) {
      throw InvalidInput("a .glb file holds at most 4 GiB");
    }
    std::string out = "glTF";
    append_uint32(out, 2);
    append_uint32(out, static_cast<std::uint32_t>(size));
    append_uint32(out, static_cast<std::uint32_t>(json.size()));
    out += "JSON" + json;
    append_uint32(out, static_cast<std::uint32_t>(bytes_.size()));
    out += std::string("BIN\0", 4);
    out.append(bytes_.begin(), bytes_.end());
    return out;
  }

 private:
  static void append_uint32(std::string& out, std::uint32_t value) {
    for (int shift = 0; shift < 32; shift += 8) out += static_cast<char>(value >> shift & 255);
  }

  template <typename T>
  int add_view(const T* data, std::size_t count, int target = 0) {
    while (bytes_.size() % 4 != 0) bytes_.push_back(0);
    Json view = {{"buffer", 0}, {"byteOffset", bytes_.size()}, {"byteLength", count * sizeof(T)}};
    if (target != 0) view["target"] = target;
    const auto* first = reinterpret_cast<const char*>(data);
    bytes_.insert(bytes_.end(), first, first + count * sizeof(T));
    json_["bufferViews"].push_back(std::move(view));
    return static_cast<int>(json_["bufferViews"].size()) - 1;
  }

  int add_accessor(Json accessor) {
    json_["accessors"].push_back(std::move(accessor));
    return static_cast<int>(json_["accessors"].size()) - 1;
  }

  int add_floats(const std::vector<float>& values, const char* type, int width, int target = 0) {
    const int view = add_view(values.data(), values.size(), target);
    return add_accessor({{"bufferView", view},
                         {"componentType", component_float},
                         {"count", values.size() / width},
                         {"type", type}});
  }

  int add_points(const PointsF& points, bool with_bounds) {
    const int view =
        add_view(points.data(), static_cast<std::size_t>(points.size()), target_array_buffer);
    Json accessor = {{"bufferView", view},
                     {"componentType", component_float},
                     {"count", points.rows()},
                     {"type", "VEC3"}};
    if (with_bounds) add_bounds(points, accessor);
    return add_accessor(std::move(accessor));
  }

  static void add_bounds(const PointsF& points, Json& accessor) {
    const Eigen::RowVector3f low = points.colwise().minCoeff(), high = points.colwise().maxCoeff();
    accessor["min"] = {low[0], low[1], low[2]};
    accessor["max"] = {high[0], high[1], high[2]};
  }

  int add_target(const GltfMorphTarget& target) {
    const Eigen::Index count = scene_.mesh.vertex_count();
    PointsF dense = PointsF::Zero(count, 3);
    dense(target.vertices, Eigen::all) = target.displacement_m;
    constexpr Eigen::Index dense_bytes = 12, sparse_bytes = 16;
    const auto moving = static_cast<Eigen::Index>(target.vertices.size());
    if (moving == 0 || moving * sparse_bytes >= count * dense_bytes) return add_points(dense, true);
    Json accessor = {{"componentType", component_float}, {"count", count}, {"type", "VEC3"}};
    const std::vector<std::uint32_t> indices(target.vertices.begin(), target.vertices.end());
    const int index_view = add_view(indices.data(), indices.size());
    const int value_view = add_view(target.displacement_m.data(),
                                    static_cast<std::size_t>(target.displacement_m.size()));
    accessor["sparse"] = {
        {"count", moving},
        {"indices", {{"bufferView", index_view}, {"componentType", component_uint32}}},
        {"values", {{"bufferView", value_view}}}};
    add_bounds(dense, accessor);
    return add_accessor(std::move(accessor));
  }

  void add_mesh() {
    const Mesh& mesh = scene_.mesh;
    const PointsF positions = mesh.positions_m.cast<float>();
    PointsF normals;
    vertex_normals(positions, mesh.triangles, normals);
    // A vertex without area around it has no normal, but the format wants unit length.
    for (Eigen::Index i = 0; i < normals.rows(); ++i) {
      if (normals.row(i).isZero()) normals(i, 2) = 1.0f;
    }
    Json primitive;
    primitive["attributes"]["POSITION"] = add_points(positions, true);
    primitive["attributes"]["NORMAL"] = add_points(normals, false);
    if (mesh.uvs.rows() > 0) primitive["attributes"]["TEXCOORD_0"] = add_uvs();
    primitive["indices"] = add_indices();
    primitive["material"] = 0;
    Json entry = {{"name", scene_.name}};
    for (const GltfMorphTarget& target : scene_.targets) {
      primitive["targets"].push_back({{"POSITION", add_target(target)}});
      entry["extras"]["targetNames"].push_back(target.name);
      entry["weights"].push_back(0.0);
    }
    entry["primitives"].push_back(std::move(primitive));
    json_["meshes"].push_back(std::move(entry));
  }

  /// glTF's v runs down from the top row.
  int add_uvs() {
    std::vector<float> values;
    for (Eigen::Index i = 0; i < scene_.mesh.uvs.rows(); ++i) {
      values.push_back(scene_.mesh.uvs(i, 0));
      values.push_back(1.0f - scene_.mesh.uvs(i, 1));
    }
    return add_floats(values, "VEC2", 2, target_array_buffer);
  }

  int add_indices() {
    const auto& triangles = scene_.mesh.triangles;
    const std::vector<std::uint32_t> indices(triangles.data(), triangles.data() + triangles.size());
    const int view = add_view(indices.data(), indices.size(), target_element_array_buffer);
    return add_accessor({{"bufferView", view},
                         {"componentType", component_uint32},
                         {"count", indices.size()},
                         {"type", "SCALAR"}});
  }

  void add_material() {
    Json surface = {{"metallicFactor", 0.0}, {"roughnessFactor", 0.8}};
    if (scene_.texture) {
      const auto bytes = encode_image(*scene_.texture, scene_.texture_format);
      const bool is_png = scene_.texture_format == ImageFormat::png;
      const int view = add_view(bytes.data(), bytes.size());
      json_["images"] = {{{"bufferView", view}, {"mimeType", is_png ? "image/png" : "image/jpeg"}}};
      json_["samplers"] = {{{"magFilter", filter_linear},
                            {"minFilter", filter_linear_mipmap_linear},
                            {"wrapS", wrap_clamp},
                            {"wrapT", wrap_clamp}}};
      json_["textures"] = {{{"sampler", 0}, {"source", 0}}};
      surface["baseColorTexture"] = {{"index", 0}};
    } else {
      surface["baseColorFactor"] = {0.7, 0.7, 0.7, 1.0};
    }
    json_["materials"] = {{{"name", scene_.name}, {"pbrMetallicRoughness", std::move(surface)}}};
  }

  void add_animation() {
    std::vector<float> times, rotations, translations, weights;
    Eigen::Quaterniond previous = Eigen::Quaterniond::Identity();
    for (const GltfKey& key : scene_.animation) {
      times.push_back(static_cast<float>(key.time_s));
      // q and -q are one rotation; neighbours on one side interpolate the short way.
      Eigen::Quaterniond q = key.world_from_model.rotation.normalized();
      if (q.dot(previous) < 0.0) q.coeffs() = -q.coeffs();
      previous = q;
      for (double value : {q.x(), q.y(), q.z(), q.w()}) {
        rotations.push_back(static_cast<float>(value));
      }
      for (double value : key.world_from_model.translation_m) {
        translations.push_back(static_cast<float>(value));
      }
      weights.insert(weights.end(), key.weights.begin(), key.weights.end());
    }
    const int input = add_floats(times, "SCALAR", 1);
    json_["accessors"][input]["min"] = {times.front()};
    json_["accessors"][input]["max"] = {times.back()};
    Json animation = {{"name", "track"}};
    const auto add_channel = [&](const char* path, int output) {
      const std::size_t sampler = animation.contains("samplers") ? animation["samplers"].size() : 0;
      animation["samplers"].push_back(
          {{"input", input}, {"interpolation", "LINEAR"}, {"output", output}});
      animation["channels"].push_back(
          {{"sampler", sampler}, {"target", {{"node", 0}, {"path", path}}}});
    };
    add_channel("rotation", add_floats(rotations, "VEC4", 4));
    add_channel("translation", add_floats(translations, "VEC3", 3));
    if (!scene_.targets.empty()) add_channel("weights", add_floats(weights, "SCALAR", 1));
    json_["animations"].push_back(std::move(animation));
  }

  const GltfScene& scene_;
  Json json_;
  std::vector<char> bytes_;
};

}  // namespace

void write_glb(const std::string& path, const GltfScene& scene) {
  check(scene, path);
  const std::string bytes = Document(scene).container();
  AtomicFile file(path);
  file.stream().write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file.commit();
}

}  // namespace semblance
