// Key frames of a mouth from a track of its markers.
#pragma once

#include <limits>
#include <optional>
#include <vector>

#include "semblance/io/lip_markers.h"
#include "semblance/models/mouth_motion.h"

namespace semblance {

/// A track of 16 markers from one of the 8 outer ones. The lips keep their thickness, which is half
/// of what lies between upper and lower markers in the frame where these are nearest to each other
/// (there the mouth is taken to be closed); the inner corners lie a tenth of that frame's width
/// inside the outer ones. Both follow the mouth's rotation. The new markers are `bridged`, and
/// absent where their outer one or a corner is. A track of 16 is returned as it is. Throws
/// InvalidInput where no frame has all 8.
LipTrack with_inner_contour(const LipTrack& track);

/// Row of the frame with this number; throws InvalidInput, naming the numbers there are.
int find_frame(const LipTrack& track, int frame);
/// True if no marker is absent.
bool is_complete(const LipFrame& frame);

/// The key frame in `row` of a track of 16 markers, with depths zero. Each marker's velocity is the
/// slope of the least-squares line through its positions in that row and up to `neighbours` rows to
/// either side where it is not absent (report, section 4.4); with `neighbours` = 0 it is the file's
/// own. Throws InvalidInput, naming the frame, if a marker is absent, or alone, so that it has no
/// slope, or so far or fast that no picture shows it, or if the corners are at one place.
MouthKey make_key(const LipTrack& track, int row, int neighbours);

/// When choose_keys has enough: at `most_keys`, or as soon as no skipped frame is off by more than
/// `tolerance_px` (root mean square over its markers).
struct KeyChoice {
  int most_keys = std::numeric_limits<int>::max();
  double tolerance_px = 1.0;
  int neighbours = 2;
  MarkerControls controls{};
  std::optional<Eigen::Vector2d> reference_px{};
};

/// Rows of key frames, greedily: the first and the last complete frame; then again and again the
/// segment with the largest squared error among those with a frame above the tolerance is split
/// where what is left of its error is least. Then every inner key moves to where it leaves least,
/// in up to five rounds. As many evenly spread keys, moved in the same way, are taken instead where
/// they are better. At most 32 evenly spread frames are tried for a place, so long tracks take time
/// in proportion to their length. It is a good choice, not the best possible one. Throws
/// InvalidInput with fewer than two complete frames or a wrong choice.
std::vector<int> choose_keys(const LipTrack& track, const KeyChoice& choice);

/// How far the motion is from the track in the frames between its keys.
struct MotionError {
  int frames = 0;       // compared: not keys, with some marker, between the first key and the last
  double rms_px = 0.0;  // over all their markers
  double worst_px = 0.0;  // root mean square over the markers of the worst frame
  int worst_frame = 0;    // its number
};
MotionError motion_error(const LipTrack& track, const std::vector<int>& key_rows,
                         const MouthMotion& motion);

}  // namespace semblance
