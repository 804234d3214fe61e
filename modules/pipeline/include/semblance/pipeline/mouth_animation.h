// A mouth animated from key frames of its markers, as pictures and as a wireframe.
//
// Source: Moubaraki, Tanaka and Kitamura, "Evaluation of the Homotopy Sweep Technique", ATR
// TR-C-0089 (1993), section 4.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "semblance/core/progress.h"
#include "semblance/models/mouth_keys.h"
#include "semblance/models/mouth_wireframe.h"

namespace semblance {

struct MouthAnimationOptions {
  std::string markers;  // lips.csv, 8 or 16 markers
  std::string folder;   // made; the one above it must exist
  /// What the markers were seen in; their frame numbers are those of the video. Empty: flat
  /// colours.
  std::string video;
  /// Take the whole texture from this frame, which needs no missing marker; otherwise each picture
  /// is blended from those of the key frames before and after it.
  std::optional<int> still_frame;
  std::string visemes;    // file; empty: the built-in face's
  std::vector<int> keys;  // frame numbers; empty: chosen by `choice`
  /// Also the velocities' neighbours, the controls and the reference point.
  KeyChoice choice;
  MouthWireframeOptions wireframe;
  /// Frame rate of what is written; 0: the video's, or 25.
  double frames_per_second = 0.0;
};

struct AnimatedKey {
  int frame = 0;
  double time_s = 0.0;
  std::string viseme;
};

struct MouthAnimationSummary {
  std::vector<AnimatedKey> keys;
  int frames = 0;  // written
  double frames_per_second = 0.0;
  MotionError error;  // against the frames between the keys
  double total_s = 0.0;
};

/// Reads, chooses keys and writes animation.mp4, wireframe.mp4 (the same with lines drawn over it),
/// animation.csv (markers, in the format of lips.csv), wireframe.json, mouth.glb, and drawings of
/// the paths and the wireframe (paths.svg, wireframe.svg) into the folder. The first and the last
/// frame are the first and the last key; the times between are even, at the rate that is nearest to
/// the one asked for.
///
/// Throws InvalidInput before anything is written; SolverError if cancelled, where files that are
/// complete stay.
MouthAnimationSummary animate_mouth(const MouthAnimationOptions& options, Progress& progress);

/// Even times from start to end, both included, at the rate nearest to `frames_per_second`. Throws
/// InvalidInput where that makes more than a million frames, or the rate is not positive.
std::vector<double> animation_times(double start_s, double end_s, double frames_per_second);

}  // namespace semblance
