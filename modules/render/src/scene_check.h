#pragma once

#include "semblance/core/camera.h"
#include "semblance/core/scene.h"
#include "semblance/render/renderer.h"

namespace semblance {

/// What every renderer asks of its input. Throws InvalidInput for a camera without pixels or with
/// distortion and for objects without a mesh or with a wrong number of positions.
void check_renderable(const Scene& scene, const Camera& camera);

/// What the colour and normal channels need besides: a normal per vertex, and for textured objects
/// texture coordinates and three channels. Throws InvalidInput.
void check_shadable(const Scene& scene, Channel channels);

}  // namespace semblance
