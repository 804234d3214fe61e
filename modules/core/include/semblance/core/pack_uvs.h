// Texture coordinates of models with several materials, for one texture.
#pragma once

#include <string>

#include "semblance/core/mesh.h"

namespace semblance {

/// Moves texture coordinates into one unit square, each place of which belongs to one place of the
/// surface: models of several materials use several squares (UDIM tiles), or the same one several
/// times. The square of the charts with most triangles becomes the largest (side 3/4, more where
/// there are over eight), the others lie above and beside it. Nothing changes where one square was
/// enough. Throws InvalidInput, naming `source`, for a connected piece that lies in more than one
/// unit square.
void pack_uvs(Mesh& mesh, const std::string& source);

}  // namespace semblance
