// Lips without dots: read off a tracked face.
#pragma once

#include <vector>

#include "semblance/io/track_file.h"
#include "semblance/lips/lip_estimate.h"

namespace semblance {

/// The 16 markers' places on the lips of a track of kind "face", from its 68 landmarks
/// (models/lip_points.h). All are "seen" where the face is tracked, for the track does not say
/// which parts of it were hidden; the confidence is the share of trusted pixels of the whole face.
/// They have no deviations: a face's are stated per parameter, without the correlations that a
/// point's would need. Throws InvalidInput naming `source` unless the track has 68 landmarks.
std::vector<LipEstimate> lips_of_face(const Track& face, const std::string& source);

}  // namespace semblance
