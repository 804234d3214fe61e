// What has passed through what.
#pragma once

#include <string>
#include <vector>

#include "placed_obstacle.h"
#include "semblance/cloth/contact.h"
#include "surface_topology.h"

namespace semblance {

/// See ContactFinder::penetrations.
std::vector<Penetration> find_penetrations(const SurfaceTopology& cloth,
                                           const std::vector<PlacedObstacle>& obstacles,
                                           const Points& positions_m, bool with_itself,
                                           bool brute_force);

/// The first of `count` penetrations as a sentence.
std::string describe(const Penetration& first, const std::vector<PlacedObstacle>& obstacles,
                     std::size_t count);

}  // namespace semblance
