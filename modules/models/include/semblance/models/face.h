// The built-in face, swept from contours by the homotopy technique.
#pragma once

#include <string>

#include "semblance/models/morph_model.h"

namespace semblance {

struct FaceResolution {
  /// Subdivision of the sweep relative to the tracker's default (about 7,000 vertices). Synthesis
  /// uses another value than tracking so that the two do not share their tessellation.
  double density = 1.0;
};

/// The face with its identity and expression parameters (at least 20 and 25), landmarks and parts.
MorphShape make_sweep_face(const FaceResolution& resolution = {});

}  // namespace semblance
