// Animated faces as glTF 2.0 (binary, .glb).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "semblance/core/mesh.h"
#include "semblance/core/rigid3.h"
#include "semblance/io/image_io.h"
#include "semblance/io/video.h"

namespace semblance {

/// How the vertices move at weight 1. Few moving vertices take little room in the file.
struct GltfMorphTarget {
  std::string name;
  std::vector<int> vertices;  // ascending
  PointsF displacement_m;     // one row per entry of `vertices`
};

/// The state at one time; between keys a viewer interpolates linearly.
struct GltfKey {
  double time_s = 0.0;
  Rigid3 world_from_model;
  std::vector<float> weights;  // one per morph target
};

struct GltfScene {
  std::string name = "face";
  Mesh mesh;
  std::optional<Rgb8> texture;  // sRGB, rows from the top; needs uvs
  ImageFormat texture_format = ImageFormat::png;
  std::vector<GltfMorphTarget> targets;
  std::vector<GltfKey> animation;  // times ascending; empty: no animation
};

/// Writes one mesh on one node, with embedded texture, morph targets (names in
/// mesh.extras.targetNames) and an animation of weights, rotation and translation. Throws
/// InvalidInput where figures do not fit together or are not finite.
void write_glb(const std::string& path, const GltfScene& scene);

}  // namespace semblance
