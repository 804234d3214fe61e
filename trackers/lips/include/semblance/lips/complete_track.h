// What a whole clip says beyond its single frames: places of hidden markers, and velocities.
#pragma once

#include <vector>

#include "semblance/lips/lip_estimate.h"

namespace semblance {

/// Longest time over which a hidden marker is bridged: about two syllables' parts.
constexpr double kLongestBridgeS = 0.5;

/// Gives hidden markers a place between the frames a and b that last and next saw them, at most
/// kLongestBridgeS apart, in frames that are not lost. The markers seen both in a and in frame t
/// say how the mouth has moved (fit_map), and so do those seen in b and t:
///   p(t) = (1 - s) A(p(a)) + s B(p(b)),   s = (t - a) / (b - a).
/// Markers there before are no longer bridged. The deviation comes from the errors of the same
/// rule, with the same markers as witnesses, in all stretches of the clip of that length in which
/// the marker was seen throughout; none where these are fewer than five. The squared errors grow
/// with how far the rule misses the witnesses themselves (a lively mouth moves less like one
/// piece): a line is fitted to them, and read off at what the rule misses them by in frame t.
void bridge_gaps(std::vector<LipEstimate>& track);

/// v(t) = (p(b) - p(a)) / (t_b - t_a) for the earliest frame a and the latest frame b within
/// `neighbours` frames of t to which the marker's state is the same (seen, or bridged) in every
/// frame from t on: central where both sides are there, one-sided at ends and gaps, zero where
/// neither is. A bridged marker's neighbours may also be seen ones.
void add_velocities(std::vector<LipEstimate>& track, int neighbours);

}  // namespace semblance
