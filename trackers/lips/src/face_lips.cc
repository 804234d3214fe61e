#include "face_lips.h"

#include <algorithm>
#include <array>

#include "semblance/core/errors.h"

namespace semblance {

std::vector<LipEstimate> lips_of_face(const Track& face, const std::string& source) {
  static constexpr std::array<std::size_t, 16> kLandmarks = {48, 50, 51, 52, 54, 56, 57, 58,
                                                             60, 61, 62, 63, 64, 65, 66, 67};
  std::vector<LipEstimate> lips;
  for (const TrackFrame& frame : face.frames) {
    LipEstimate estimate;
    estimate.frame = frame.frame;
    estimate.time_s = frame.time_s;
    estimate.status = frame.status;
    estimate.markers.resize(kLandmarks.size());
    if (frame.status != TrackStatus::lost) {
      if (frame.landmarks_px.size() != 68) {
        throw InvalidInput(source + ": frame " + std::to_string(frame.frame) + " has " +
                           std::to_string(frame.landmarks_px.size()) +
                           " landmarks; lips need a face model with the 68 of iBUG");
      }
      for (std::size_t i = 0; i < kLandmarks.size(); ++i) {
        estimate.markers[i].marker.state = MarkerState::seen;
        estimate.markers[i].marker.position_px = frame.landmarks_px[kLandmarks[i]];
      }
      estimate.residual_rms = frame.residual_rms;
      estimate.confidence = std::clamp(frame.inlier_fraction, 0.0, 1.0);
    }
    lips.push_back(std::move(estimate));
  }
  return lips;
}

}  // namespace semblance
