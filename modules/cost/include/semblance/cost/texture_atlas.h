// Where every texel of a mesh's texture lies on its surface.
#pragma once

#include <cstdint>
#include <vector>

#include "semblance/core/mesh.h"

namespace semblance {

/// Texels of a width x height texture that a triangle covers (by its uvs), plus a border of one
/// texel around each chart, taken to lie on the chart's edge, so that bilinear look-ups at the edge
/// find a colour. Rows from the top: v = 1 - (row + 0.5) / height.
struct TextureAtlas {
  int width = 0, height = 0;
  std::vector<std::int32_t> texel;     // row * width + column, ascending
  std::vector<std::int32_t> triangle;  // of the mesh
  std::vector<float> b1, b2;           // affine barycentrics in uv space

  std::size_t size() const { return texel.size(); }
};

TextureAtlas make_texture_atlas(const Mesh& mesh, int width, int height);

}  // namespace semblance
