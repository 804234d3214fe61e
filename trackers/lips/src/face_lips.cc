#include "face_lips.h"

#include <algorithm>

#include "semblance/core/errors.h"
#include "semblance/models/lip_points.h"

namespace semblance {

std::vector<LipEstimate> lips_of_face(const Track& face, const std::string& source) {
  std::vector<LipEstimate> lips;
  for (const TrackFrame& frame : face.frames) {
    LipEstimate estimate;
    estimate.frame = frame.frame;
    estimate.time_s = frame.time_s;
    estimate.status = frame.status;
    estimate.markers.resize(lip_points.size());
    if (frame.status != TrackStatus::lost) {
      if (frame.landmarks_px.size() != 68) {
        throw InvalidInput(source + ": frame " + std::to_string(frame.frame) + " has " +
                           std::to_string(frame.landmarks_px.size()) +
                           " landmarks; lips need a face model with the 68 of iBUG");
      }
      for (std::size_t i = 0; i < lip_points.size(); ++i) {
        estimate.markers[i].marker.state = MarkerState::seen;
        estimate.markers[i].marker.position_px = lip_point(frame.landmarks_px, static_cast<int>(i));
      }
      estimate.residual_rms = frame.residual_rms;
      estimate.confidence = std::clamp(frame.inlier_fraction, 0.0, 1.0);
    }
    lips.push_back(std::move(estimate));
  }
  return lips;
}

}  // namespace semblance
