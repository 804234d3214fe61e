// What is known of the lips' markers in one frame, and its line in track.jsonl.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "semblance/io/lip_markers.h"
#include "semblance/io/track_file.h"

namespace semblance {

struct TrackedMarker {
  LipMarker marker;
  Eigen::Vector2d sigma_px = Eigen::Vector2d::Constant(-1.0);  // negative: there is none
  bool known() const { return marker.state != MarkerState::absent; }
};

struct LipEstimate {
  int frame = 0;
  double time_s = 0.0;
  TrackStatus status = TrackStatus::lost;  // lost: all markers are absent
  double confidence = 0.0;                 // in [0, 1]; 0 when lost
  double residual_rms = 0.0;               // of the dots' fits, relative to their contrast
  std::vector<TrackedMarker> markers;
};

/// Distance of the middles of upper and lower lip over that of the corners: on the inner contour
/// with 16 markers, on the outer one with 8. NaN where one of the four has no place.
double mouth_opening(const LipEstimate& estimate);

/// Lines of a track file of kind "lips" (docs/formats/track.md) and back. Reading throws
/// InvalidInput naming `source` and the frame where the fields are not those of such a file.
TrackFrame to_track_frame(const LipEstimate& estimate);
LipEstimate from_track_frame(const TrackFrame& frame, int marker_count, const std::string& source);

LipTrack to_lip_track(const std::vector<LipEstimate>& estimates, int marker_count);

}  // namespace semblance
