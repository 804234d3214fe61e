// Which further picture of the sheet would help most.
#pragma once

#include <optional>

#include "projection_map.h"
#include "semblance/cameras/judge.h"

namespace semblance {

/// The best of a fixed set of places of a flat sheet before the camera: over the picture, two
/// distances, and tilted about both axes. Each is judged by the mean deviation of the projection
/// that it leaves, from the information of its points once its own pose is eliminated (Schur's
/// complement). None for points that are not flat, and for intrinsics that were not sought.
std::optional<NextView> next_view(const Adjustment& adjustment, int camera,
                                  const ProjectionMap& map);

}  // namespace semblance
