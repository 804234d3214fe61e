// What needs the whole clip: smoothing, and the focal length.
#pragma once

#include <string>

#include "semblance/core/progress.h"
#include "semblance/face/face_bundle.h"
#include "semblance/face/face_tracker.h"

namespace semblance {

/// Frames among the first 240 that show the face from different sides, the first tracked one always
/// with them: up to twelve, chosen so that the least different pair differs most. Empty where fewer
/// than three were found: then there is no parallax to learn from.
std::vector<Keyframe> find_keyframes(const std::string& video, const Camera& camera,
                                     const MorphShape& shape, const FaceTrackerOptions& options,
                                     Progress& progress);

/// Replaces the estimates of `track` by those of a solve over all frames together, in both
/// directions in time: image terms linearised anew in each of three rounds, constant velocity
/// between frames. Identity and texture stay those of the tracker.
void smooth_track(const std::string& video, const FaceTracker& tracker, const Camera& camera,
                  std::vector<TrackFrame>& frames, Progress& progress);

/// Focal length that lets the face explain the clip best.
struct FocalEstimate {
  double focal_px = 0.0;
  double sigma_px = 0.0;  // from the curvature of the residual; infinite where it has no minimum
};

/// Tracks every tenth frame with nine focal lengths from 0.6 to 2.4 picture widths and takes the
/// minimum of a parabola through the mean residuals over log focal. One face only tells the focal
/// length if it turns or approaches: the deviation says how well.
FocalEstimate estimate_focal(const std::string& video, const MorphShape& shape,
                             const FaceTrackerOptions& options, Progress& progress);

}  // namespace semblance
