// How far tracked lip markers are from the truth.
#pragma once

#include <string>
#include <vector>

#include "semblance/io/lip_markers.h"
#include "semblance/synth/score.h"

namespace semblance {

/// Of one clip, or of all clips together. Counts are of markers in frames.
struct LipScore {
  std::string name;
  int visible = 0;   ///< can be seen, says the truth
  int seen = 0;      ///< of those, seen by the track
  int missed = 0;    ///< of those, without a place in the track
  int bridged = 0;   ///< filled in by the track, visible or hidden
  int invented = 0;  ///< said to be seen though hidden, and off by more than a third of the way to
                     ///< the nearest other marker
  int swapped = 0;   ///< said to be seen, but closer to another marker's true place
  int lost_frames = 0;  ///< frames in which no marker has a place
  int frames = 0;
  Spread seen_px, bridged_px;  ///< distances from the true places
  Spread velocity_px_s;        ///< of the seen ones' velocities from the true ones
  std::vector<double> seen_errors_px, bridged_errors_px, velocity_errors_px_s;  ///< behind them
};

/// Frames are paired by their number; truth that the track lacks counts as lost. Throws
/// InvalidInput naming the clip where the numbers of markers differ.
LipScore score_lips(const std::string& name, const LipTrack& track, const LipTrack& truth);
/// All clips together.
LipScore total_score(const std::vector<LipScore>& clips);

/// The clips and their total, as JSON text and as a table.
std::string lip_score_json(const std::vector<LipScore>& clips);
std::string lip_score_table(const std::vector<LipScore>& clips);

}  // namespace semblance
