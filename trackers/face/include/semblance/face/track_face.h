// Tracks the face in a video file and writes everything a user wants of it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "semblance/core/progress.h"
#include "semblance/pipeline/tracking_run.h"

namespace semblance {

struct FaceTrackingOptions {
  std::string video;
  std::string folder;             // created if its parent exists
  std::string camera;             // semblance.camera/1 file; empty: a camera is assumed
  std::string model = "builtin";  // as load_face takes it
  std::string points;             // marks of the first frame (.pts or .json of the 68), or empty
  double focal_px = 0.0;          // of the assumed camera; 0: kDefaultFocal times the width
  bool estimate_focal = false;    // choose the focal length that explains the clip best
  std::string optimizer = "lm";
  bool smooth = false;  // a second solve of the whole clip in both directions
  bool resume = false;
  bool overlay = true;      // overlay.mp4
  std::optional<int> face;  // which of several, from the left
  std::uint64_t seed = 1;
  int last_frame = -1;
  int checkpoint_every = 100;  // frames between the states that `resume` goes on from
};

/// Focal length assumed without a camera, in widths of the picture: the middle of webcams (a
/// horizontal field of view of 51 degrees).
constexpr double kDefaultFocal = 1.05;

struct FaceTrackingSummary {
  TrackingOutcome outcome;
  double focal_px = 0.0;
  std::optional<double> focal_sigma_px;  // where it was estimated
  double frames_per_second = 0.0;        // of the whole run, with decoding and writing
  std::vector<std::string> notes;        // what was assumed of the input, for people
};

/// Writes track.jsonl, track.csv, overlay.mp4, face.glb and report.html into the folder. A
/// cancelled run (Ctrl-C) keeps what is done, with all files valid, and `resume` goes on to the
/// same result. Throws InvalidInput or IoError before anything is written where the input is at
/// fault, and SolverError if no frame at all could be tracked.
FaceTrackingSummary track_face(const FaceTrackingOptions& options, Progress& progress);

}  // namespace semblance
