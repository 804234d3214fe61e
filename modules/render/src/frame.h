#pragma once

#include "semblance/render/renderer.h"

namespace semblance {

/// A picture of the camera's size that sees nothing: the images of `channels`, filled with the
/// background, -1 or 0.
Frame empty_frame(const Scene& scene, const Camera& camera, Channel channels);

}  // namespace semblance
