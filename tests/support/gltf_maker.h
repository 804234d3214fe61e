// glTF files made by hand, for tests of their readers.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace semblance::testing {

/// The JSON of a file and its one buffer.
struct GltfMaker {
  nlohmann::json json = {{"asset", {{"version", "2.0"}}}};
  std::string bytes;

  template <typename T>
  int add_view(const std::vector<T>& values) {
    while (bytes.size() % 4 != 0) bytes += '\0';
    json["bufferViews"].push_back(
        {{"buffer", 0}, {"byteOffset", bytes.size()}, {"byteLength", values.size() * sizeof(T)}});
    bytes.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
    return static_cast<int>(json["bufferViews"].size()) - 1;
  }

  /// Returns the number of the accessor.
  template <typename T>
  int add(const std::vector<T>& values, const std::string& type, bool normalized = false) {
    const int width = type == "SCALAR" ? 1 : type == "MAT4" ? 16 : type.back() - '0';
    nlohmann::json accessor = {{"bufferView", add_view(values)},
                               {"componentType", component_type(T{})},
                               {"count", values.size() / width},
                               {"type", type}};
    if (normalized) accessor["normalized"] = true;
    json["accessors"].push_back(std::move(accessor));
    return static_cast<int>(json["accessors"].size()) - 1;
  }

  /// Adds a channel to the last animation; times and values are accessors.
  void add_channel(int node, const char* path, int times, int values,
                   const char* interpolation = "LINEAR") {
    nlohmann::json& animation = json["animations"].back();
    const std::size_t sampler = animation.contains("samplers") ? animation["samplers"].size() : 0;
    animation["samplers"].push_back(
        {{"input", times}, {"output", values}, {"interpolation", interpolation}});
    animation["channels"].push_back(
        {{"sampler", sampler}, {"target", {{"node", node}, {"path", path}}}});
  }

  /// NAME.gltf with NAME.gltf.bin beside it.
  void write_text(const std::string& path) const {
    nlohmann::json out = json;
    const std::string name = path.substr(path.rfind('/') + 1) + ".bin";
    out["buffers"] = {{{"byteLength", bytes.size()}, {"uri", name}}};
    std::ofstream(path) << out;
    std::ofstream(path + ".bin", std::ios::binary) << bytes;
  }

  std::string binary() const {
    nlohmann::json out = json;
    std::string body = bytes;
    while (body.size() % 4 != 0) body += '\0';
    out["buffers"] = {{{"byteLength", body.size()}}};
    std::string text = out.dump();
    while (text.size() % 4 != 0) text += ' ';
    return "glTF" + uint32(2) + uint32(28 + text.size() + body.size()) + uint32(text.size()) +
           "JSON" + text + uint32(body.size()) + std::string("BIN\0", 4) + body;
  }

  void write_binary(const std::string& path) const {
    std::ofstream(path, std::ios::binary) << binary();
  }

 private:
  static int component_type(std::int8_t) { return 5120; }
  static int component_type(std::uint8_t) { return 5121; }
  static int component_type(std::int16_t) { return 5122; }
  static int component_type(std::uint16_t) { return 5123; }
  static int component_type(std::uint32_t) { return 5125; }
  static int component_type(float) { return 5126; }
  static std::string uint32(std::size_t value) {
    std::string out;
    for (int shift = 0; shift < 32; shift += 8) out += static_cast<char>(value >> shift & 255);
    return out;
  }
};

/// A square bar from y = 0 to 2 with ends, 0.4 wide, in `bar_rings` rings of four vertices; closed.
constexpr int bar_rings = 9;
inline double bar_height(int ring) { return 2.0 * ring / (bar_rings - 1); }
/// Of the upper joint; the lower one has the rest.
inline double bar_weight(int ring) {
  return std::min(1.0, std::max(0.0, (bar_height(ring) - 0.5) / 1.0));
}
inline Eigen::Vector3d bar_vertex(int ring, int corner) {
  return {corner == 0 || corner == 3 ? 0.2 : -0.2, bar_height(ring), corner < 2 ? 0.2 : -0.2};
}

/// Two joints, at y = 0 and y = 1, bend the bar about z: the upper one turns by `bend_rad` in 1 s.
/// Nodes: 0 the mesh, 1 the lower joint, 2 the upper one.
inline GltfMaker bending_bar(double bend_rad) {
  GltfMaker maker;
  std::vector<float> positions, weights;
  std::vector<std::uint8_t> joints;
  std::vector<std::uint16_t> triangles;
  for (int ring = 0; ring < bar_rings; ++ring) {
    for (int corner = 0; corner < 4; ++corner) {
      for (const double x : bar_vertex(ring, corner)) positions.push_back(static_cast<float>(x));
      const auto upper = static_cast<float>(bar_weight(ring));
      weights.insert(weights.end(), {upper, 1.0f - upper, 0.0f, 0.0f});
      joints.insert(joints.end(), {1, 0, 0, 0});
      if (ring + 1 == bar_rings) continue;
      const int a = 4 * ring + corner, b = 4 * ring + (corner + 1) % 4;
      for (const int v : {a, a + 4, b, b, a + 4, b + 4}) {
        triangles.push_back(static_cast<std::uint16_t>(v));
      }
    }
  }
  const int top = 4 * (bar_rings - 1);
  for (const int v : {0, 1, 2, 0, 2, 3, top, top + 2, top + 1, top, top + 3, top + 2}) {
    triangles.push_back(static_cast<std::uint16_t>(v));
  }
  const std::vector<float> inverse_binds = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0,  0, 1,
                                            1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -1, 0, 1};
  maker.json["meshes"] = {{{"primitives",
                            {{{"attributes",
                               {{"POSITION", maker.add(positions, "VEC3")},
                                {"JOINTS_0", maker.add(joints, "VEC4")},
                                {"WEIGHTS_0", maker.add(weights, "VEC4")}}},
                              {"indices", maker.add(triangles, "SCALAR")}}}}}};
  maker.json["nodes"] = {{{"mesh", 0}, {"skin", 0}},
                         {{"name", "lower"}, {"children", {2}}},
                         {{"name", "upper"}, {"translation", {0, 1, 0}}}};
  maker.json["scenes"] = {{{"nodes", {0, 1}}}};
  maker.json["skins"] = {
      {{"joints", {1, 2}}, {"inverseBindMatrices", maker.add(inverse_binds, "MAT4")}}};
  maker.json["animations"] = {{{"name", "bend"}}};
  const auto sine = static_cast<float>(std::sin(0.5 * bend_rad));
  const auto cosine = static_cast<float>(std::cos(0.5 * bend_rad));
  const int times = maker.add(std::vector<float>{0, 1}, "SCALAR");
  const int turns = maker.add(std::vector<float>{0, 0, 0, 1, 0, 0, sine, cosine}, "VEC4");
  maker.add_channel(2, "rotation", times, turns);
  return maker;
}

/// Where a vertex of the bar is when the upper joint has turned by that much.
inline Eigen::Vector3d bent_bar_vertex(int ring, int corner, double turn_rad) {
  const Eigen::Vector3d p = bar_vertex(ring, corner);
  const double c = std::cos(turn_rad), s = std::sin(turn_rad), w = bar_weight(ring);
  const Eigen::Vector3d turned(c * p.x() - s * (p.y() - 1.0), 1.0 + s * p.x() + c * (p.y() - 1.0),
                               p.z());
  return (1.0 - w) * p + w * turned;
}

}  // namespace semblance::testing
