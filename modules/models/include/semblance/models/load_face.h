// Face models from files.
#pragma once

#include <string>

#include "semblance/models/morph_model.h"

namespace semblance {

struct FaceLoadOptions {
  /// Identity parameters kept, from the first: the most telling come first in models made by
  /// principal components. Expression parameters are always kept.
  int identity_limit = 100;
  /// Displacements shorter than this are left out; a shape whose longest is below ten times this
  /// is noise of the file's number format and no parameter.
  float threshold_m = 1e-5f;
};

/// A face model from: "builtin"; an ICT FaceKit folder (neutral OBJ, vertex_indices.json, deltas;
/// centimetres are recognised); a folder with a neutral OBJ and one OBJ per shape; or a glTF/GLB
/// with morph targets (docs/formats/model.md). Scaled to metres by a stated rule when the file's
/// unit is not known (the distance between the eyes, where landmarks are known, else the height).
/// Throws InvalidInput, or IoError where a file cannot be read.
MorphShape load_face(const std::string& name_or_path, const FaceLoadOptions& options = {});

/// "mouth_smile_left" from "mouthSmile_L" or "mouthSmileLeft": the names of parameters.
std::string parameter_name(const std::string& shape_name);

}  // namespace semblance
