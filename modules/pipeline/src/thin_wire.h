// A few evenly spread lines instead of every edge of a mesh.
#pragma once

#include <array>
#include <vector>

#include "semblance/core/mesh.h"

namespace semblance {

/// Straight lines between chosen vertices of a mesh.
struct ThinWire {
  std::vector<int> vertices;              // rows of the mesh
  std::vector<std::array<int, 2>> edges;  // pairs of positions in `vertices`
};

/// Chooses at most `count` vertices by farthest-point sampling along the surface and joins those
/// whose geodesic Voronoi cells touch. Distances are scaled so that the choice is half as uneven as
/// the mesh itself: a model that spends its vertices on eyes and lips gets more lines there. Parts
/// smaller than a twentieth of the surface (eyeballs, teeth) are left out.
ThinWire thin_wire(const Mesh& mesh, int count);

}  // namespace semblance
