// A tracked face for other programs.
#pragma once

#include <string>

#include "semblance/core/image.h"
#include "semblance/io/track_file.h"
#include "semblance/models/morph_model.h"

namespace semblance {

/// Writes the face as binary glTF: mesh with the identity of the last frame that has an estimate,
/// texture (linear RGB; empty: none), a morph target per expression parameter and the track's
/// animation of weights, rotation and translation.
///
/// A parameter whose fields are straight has one target, its shape at 1, and its value is the
/// weight: the animation then equals the model. A homotopy path or a rotation has one target at 1
/// (or its upper bound, if less), and one named NAME_negative at -1 (or its lower bound) where it
/// reaches below zero. The weight is the one that brings the target nearest to the model's surface,
/// so the ends are exact and values between them differ by at most `blend_deviation_m`: for the
/// built-in face less than 2.5 mm (the chin, with the jaw half open).
///
/// Lost frames have no keys: the last known state is held and ends one frame before the next
/// estimate. Throws InvalidInput if the track is not of this shape or has no estimate at all.
void write_face_glb(const std::string& path, const MorphShape& shape, const Image& texture,
                    const Track& track);

/// The greatest distance of a vertex, over the range of an expression parameter, between the model
/// and its morph targets as write_face_glb drives them (0 for straight fields).
double blend_deviation_m(const MorphShape& shape, int parameter);

}  // namespace semblance
