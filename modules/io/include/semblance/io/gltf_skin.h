// Skinned meshes from glTF 2.0 files, text or binary.
#pragma once

#include <string>

#include "semblance/geometry/skinned_mesh.h"

namespace semblance {

/// All meshes of the file's scene as one, in the order of their nodes: skinned ones with the joints
/// of their skins, others with their nodes as joints, so that both follow the file's animations.
/// Vertices are doubled along seams, as in the file (see `without_seams`). Metres, y up; uvs if
/// all parts have them. Morph targets stay at weight 0, pictures and materials are left out. Throws
/// InvalidInput where the scene has no triangle, and as GltfFile does; IoError where the file
/// cannot be read.
SkinnedMesh read_gltf_skin(const std::string& path);

}  // namespace semblance
