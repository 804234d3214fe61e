// Edges to a fraction of a pixel.
#pragma once

#include <vector>

#include "semblance/cost/contour.h"
#include "semblance/cost/observation.h"

namespace semblance {

/// Moves targets that `find_contour` placed to whole pixels to where the colours of both sides,
/// taken from beside the edge, balance: the edge of a blurred step is where its missing part equals
/// its spill (Tabatabai and Mitchell, "Edge location to subpixel values in digital imagery", PAMI
/// 1984). Where the sides differ too little from each other, or too much within themselves, a
/// target stays where it is and keeps its deviation. `least_sigma_px` is what moved targets have at
/// least.
void sharpen_outline(std::vector<ContourTarget>& outline, const ObservationLevel& observation,
                     double least_sigma_px);

}  // namespace semblance
