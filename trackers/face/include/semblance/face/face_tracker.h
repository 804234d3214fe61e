// Follows one face through a video, frame by frame.
#pragma once

#include <iosfwd>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "semblance/face/face_bundle.h"
#include "semblance/face/face_fitter.h"
#include "semblance/pipeline/clip_smoother.h"
#include "semblance/pipeline/tracking_run.h"

namespace semblance {

struct FaceTrackerOptions {
  std::string optimizer = "lm";  // of the frame loop: see optimizer_names()
  std::uint64_t seed = 1;
  std::optional<int> face;  // which of several faces to start on, from the left; 0 is leftmost
  std::vector<FaceMark> first_marks;  // start from these instead of the detector
  int texture_size = 512;
};

/// Analysis by synthesis per frame: predict the pose, render the textured face, compare with the
/// image, change pose and expression until the two look alike, from coarse to fine; then update the
/// light, fill parts of the texture that were not seen before, and judge whether to believe it.
class FaceTracker : public FrameTracker {
 public:
  /// `camera` must be free of distortion: undistort the images first.
  FaceTracker(MorphShape shape, const Camera& camera, const FaceTrackerOptions& options);
  ~FaceTracker() override;

  /// Names of all parameters that frames report: pose, identity, expression.
  const ParameterSpace& parameters() const;
  std::vector<std::string> landmark_names() const;

  /// The next frame. A frame whose face is not found, or whose fit is not believed, is lost: it has
  /// no estimate, and the following frames search anew. Throws InvalidInput if the first frame with
  /// faces shows several and none was chosen.
  TrackFrame track(int frame, double time_s, const Observation& observation) override;

  /// Settles the person before tracking starts: shape and texture from keyframes of the clip, whose
  /// estimates are a tracker's. The next frame is sought near the first keyframe.
  void learn_person(const std::vector<Keyframe>& keyframes);

  int pyramid_levels() const override;
  /// True once a face was found.
  bool has_identity() const;
  /// The person's face (identity fixed) and albedo as gathered so far. Throws before the first fit.
  const MorphShape& shape() const;
  Image texture() const;
  /// The posed scene of a tracked frame, for overlays.
  void pose_scene(const TrackFrame& frame, Scene& scene) const;

  /// For a whole-clip solve: the parameters of one frame of this person (pose and expression), the
  /// image's Gauss-Newton model around a frame's estimate (without temporal terms), and the line
  /// of a frame with the solve's estimate in place of the tracker's. A lost frame stays lost.
  const ParameterSpace& frame_parameters() const;
  ClipFrame linearize(const TrackFrame& frame, const Observation& observation) const;
  void replace_estimate(const SmoothedFrame& smoothed, TrackFrame& frame) const;

  void save_state(std::ostream& out) const override;
  void restore_state(std::istream& in, const std::string& source) override;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace semblance
