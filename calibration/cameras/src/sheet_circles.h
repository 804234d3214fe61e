// Circles printed on sheets: the centres of their images are not the images of their centres.
#pragma once

#include <vector>

#include "semblance/cameras/adjustment.h"

namespace semblance {

/// The adjustment of a flat sheet's sightings (z = 0) anew, with centres corrected for perspective
/// as the estimates and the circles' own radii say. `radius_px`: of each sighting's circle of equal
/// area; empty for sheets of other kinds, whose adjustment comes back as it is.
Adjustment with_circles_corrected(Adjustment found, const std::vector<double>& radius_px);

}  // namespace semblance
