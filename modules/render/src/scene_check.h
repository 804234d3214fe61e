#pragma once

#include "semblance/core/camera.h"
#include "semblance/core/scene.h"

namespace semblance {

/// What every renderer asks of its input. Throws InvalidInput for a camera without pixels or with
/// distortion and for objects without a mesh or with a wrong number of positions.
void check_renderable(const Scene& scene, const Camera& camera);

}  // namespace semblance
