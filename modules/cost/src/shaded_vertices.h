// Per-vertex input of the pixel passes.
#pragma once

#include <vector>

#include "photometric_kernel.h"
#include "semblance/core/scene.h"

namespace semblance::detail {

/// Texel coordinates and encoded light at every vertex of the scene's first object. Light varies
/// slowly over triangles of a few pixels, so it is evaluated here and interpolated.
void shade_vertices(const Scene& scene, int texture_width, int texture_height,
                    std::vector<VertexRecord>& out);

}  // namespace semblance::detail
