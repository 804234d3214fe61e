// The 68 landmarks of the iBUG (300-W) scheme on the built-in face.
#pragma once

#include <vector>

#include "face_sweep.h"

namespace semblance::face {

/// "ibug_00" to "ibug_67" as places inside triangles of the layout's skin.
std::vector<ModelLandmark> ibug_landmarks(const Layout& layout);

}  // namespace semblance::face
