// Tracks the lips in a video file and writes everything a user wants of them.
#pragma once

#include <string>

#include "semblance/core/progress.h"
#include "semblance/pipeline/tracking_run.h"

namespace semblance {

struct LipTrackingOptions {
  std::string video;
  std::string folder;       // created if its parent exists
  int markers = 16;         // painted dots: 8 or 16; 0: none, the face tracker's lips are taken
  int velocity_frames = 1;  // neighbours to each side (add_velocities)
  bool resume = false;
  bool overlay = true;  // overlay.mp4
  int last_frame = -1;
};

struct LipTrackingSummary {
  TrackingOutcome outcome;
  int seen = 0, bridged = 0, absent = 0;  // markers over all frames
  double median_sigma_px = 0.0;           // of the seen ones; NaN where there is none
  double median_opening = 0.0;            // mouth_opening; NaN where it is never known
};

/// Writes track.jsonl (kind "lips"), lips.csv, overlay.mp4 and report.html with the mouth's opening
/// over time into the folder; without markers also all that track_face makes, in its folder face.
/// Tracking runs forward; then gaps are bridged and velocities taken over the whole clip. A
/// cancelled run (Ctrl-C) keeps what is done, with all files valid, and `resume` goes on to the
/// same result. Throws InvalidInput or IoError before anything is written where the input is at
/// fault, and SolverError, leaving nothing, if no frame shows all markers.
LipTrackingSummary track_lips(const LipTrackingOptions& options, Progress& progress);

}  // namespace semblance
