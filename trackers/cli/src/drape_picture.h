// Pictures of a simulated sheet.
#pragma once

#include "semblance/cloth/cloth_system.h"
#include "semblance/core/image.h"

namespace semblance::cli {

/// The sheet among its obstacles, from above and the side; its face is blue and its back light,
/// with lines every 5 cm of the fabric (of small sheets closer).
Image draw_drape(const ClothScene& scene, const Points& positions_m, double time_s);

/// The sheet in its own plane, u to the right and v up, every tension spring coloured by how much
/// it is compressed: black for not at all, white for what only one in 500 exceeds, as written below
/// (mirages-2006, Fig. 30). Of triangles, each is filled with the larger of its two strains.
Image draw_compression(const Sheet& sheet, const Deformation& deformation,
                       const std::vector<double>& elongations);

}  // namespace semblance::cli
