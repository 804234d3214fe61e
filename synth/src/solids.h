// Simple closed surfaces: a lofted torso and a hand of rounded limbs.
#pragma once

#include <vector>

#include "semblance/core/mesh.h"

namespace semblance {

/// A horizontal superellipse: height, half axes and shift towards -z, metres.
struct Ring {
  float y_m, half_width_m, half_depth_m, back_m;
};

/// Joins rings, top first, of `around` vertices; |x/a|^exponent + |z/b|^exponent = 1.
Mesh loft(const std::vector<Ring>& rings, int around, float exponent);

/// A right hand, palm towards -z, fingers along +x, centred on the middle of the fingers.
Mesh hand_mesh();

}  // namespace semblance
