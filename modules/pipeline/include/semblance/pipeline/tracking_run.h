// The tracking loop: video in, one result line per frame out, whatever is tracked.
#pragma once

#include <functional>
#include <iosfwd>
#include <string>

#include "semblance/core/progress.h"
#include "semblance/cost/observation.h"
#include "semblance/io/track_file.h"
#include "semblance/io/video.h"

namespace semblance {

/// Something that follows its object from frame to frame.
class FrameTracker {
 public:
  virtual ~FrameTracker() = default;
  virtual TrackFrame track(int frame, double time_s, const Observation& observation) = 0;
  /// Pyramid levels `track` needs in its observations.
  virtual int pyramid_levels() const = 0;
  /// All that later frames depend on, in this machine's binary form: a restored tracker gives the
  /// same bytes as one that was never interrupted.
  virtual void save_state(std::ostream& out) const = 0;
  /// Throws InvalidInput naming `source` if the state is damaged or was saved by another set-up.
  virtual void restore_state(std::istream& in, const std::string& source) = 0;
};

struct TrackingRun {
  std::string video;
  std::string folder;  // existing; receives track.jsonl and, while running, checkpoint.bin
  Camera camera;       // of the video's size, possibly distorted
  TrackHeader header;
  bool resume = false;  // go on from the folder's last checkpoint; without one, from the start
  int last_frame = -1;  // stop after this frame; -1: to the end
  int checkpoint_every = 100;
};

struct StageTimes {
  double decode_s = 0, track_s = 0, total_s = 0;  // decoding overlaps with tracking
};

struct TrackingOutcome {
  int frames = 0, tracked = 0, lost = 0, reinitialised = 0;
  bool cancelled = false;
  StageTimes times;
};

/// Called for every frame in order, also those done before a resume: the 8-bit frame as tracked
/// (undistorted) and its result.
using FrameSink = std::function<void(const Rgb8& frame, const TrackFrame& result)>;

/// Decodes and prepares frames on a second thread, tracks them, appends each result to
/// folder/track.jsonl and flushes it. Cancelling (progress) and `last_frame` leave a valid file and
/// a checkpoint; the end of the video removes the checkpoint.
/// Throws InvalidInput for a video without frames, of another size than the camera, or, on resume,
/// a folder that was made with another video, camera, model or options.
TrackingOutcome run_tracking(const TrackingRun& run, FrameTracker& tracker, const FrameSink& sink,
                             Progress& progress);

}  // namespace semblance
