// Pictures of scanned and reconstructed surfaces.
#pragma once

#include "semblance/core/image.h"
#include "semblance/geometry/range_map.h"
#include "semblance/io/video.h"

namespace semblance {

/// The surface seen from the front, half turned and from the side, under one lamp. Linear RGB.
Image shaded_views(const RangeMap& map, int height_px);

/// Radial errors of `radius_m` over the map, highest row first: white without error, red where it
/// lies outside the map's surface, blue inside, full at `full_scale_m`; grey where not measured.
Rgb8 error_picture(const RangeMap& map, const Grid& radius_m, double full_scale_m);

}  // namespace semblance
