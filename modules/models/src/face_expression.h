// Expressions of the built-in face as displacement fields with weights common to all vertices.
#pragma once

#include <vector>

#include "face_sweep.h"

namespace semblance::face {

/// An expression's parameter and its fields; the fields' `parameter` counts expressions from 0, and
/// displacements are in metres.
struct Expressions {
  std::vector<ParameterBlock> parameters;
  std::vector<MorphField> fields;
};

/// `neutral` holds the positions of `places` in millimetres: sweep(places, identity).
Expressions make_expressions(const std::vector<Place>& places, const Points& neutral,
                             const Identity& identity);

}  // namespace semblance::face
