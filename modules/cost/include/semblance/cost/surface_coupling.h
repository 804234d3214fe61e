// One block of the matrix that couples the motions of a surface's vertices.
#pragma once

#include <cstdint>

namespace semblance {

/// A 2x2 block [xx xy; xy yy] that couples a vertex with the vertex number `slot`.
struct SurfaceCoupling {
  std::int32_t slot = 0;
  float xx = 0.0f, xy = 0.0f, yy = 0.0f;
};

}  // namespace semblance
