// Frames decoded and prepared ahead of whoever uses them.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "semblance/core/camera.h"
#include "semblance/cost/observation.h"
#include "semblance/io/video.h"

namespace semblance {

struct PreparedFrame {
  int index = 0;
  Rgb8 picture;             // undistorted
  Observation observation;  // empty before the first prepared frame
};

/// Decodes a video, removes the camera's distortion and builds pyramids on a thread of its own, a
/// few frames ahead. What goes wrong there is thrown by `next`.
class FrameFeed {
 public:
  /// Observations of `levels` levels are made from frame `first_prepared` on.
  FrameFeed(const std::string& video, const Camera& camera, int levels, int first_prepared);
  ~FrameFeed();

  /// The next frame, nothing at the end.
  std::optional<PreparedFrame> next();
  /// Time its thread has worked so far.
  double busy_s() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace semblance
