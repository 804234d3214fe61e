// Face models from files.
#pragma once

#include <string>

#include "semblance/models/morph_model.h"

namespace semblance {

/// A face model from: "builtin"; an ICT FaceKit folder (neutral OBJ, vertex_indices.json, deltas;
/// centimetres are recognised); a folder with a neutral OBJ and one OBJ per shape; or a glTF/GLB
/// with morph targets. Scaled to metres by a stated rule when the file's unit is not known (the
/// distance between the eyes, where landmarks are known, else the height). Throws InvalidInput.
MorphShape load_face(const std::string& name_or_path);

}  // namespace semblance
