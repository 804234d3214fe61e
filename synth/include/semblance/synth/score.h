// How far a track is from the truth.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "semblance/io/track_file.h"

namespace semblance {

/// A track and what it should have been.
struct ScoredClip {
  std::string name;
  Track track;
  Track truth;  ///< as generate_clip writes it
};

/// Median and 95th percentile over frames; NaN (JSON null) where there is no frame.
struct Spread {
  double median, p95;
};

/// Share of errors within one and two stated sigmas (a correct Gaussian: 0.683 and 0.954).
struct Coverage {
  double one_sigma, two_sigma;  // NaN without stated sigmas
  int count = 0;
};

/// Landmark errors: mean distance over the landmarks of a frame, in percent of the distance between
/// the outer eye corners in that frame's true picture (the norm of the 300-W benchmark).
struct LandmarkScore {
  Spread all_68;      ///< hidden ones included
  Spread visible_68;  ///< those that the truth says can be seen
  Spread inner_51;    ///< without the jaw line (17 to 67)
  Spread corners;     ///< eye and mouth corners (36, 39, 42, 45, 48, 54)
};

/// Figures of one clip, or of all clips together.
///
/// Two face models differ in what they call straight ahead, in their origin and in where exactly a
/// landmark sits. Each error is therefore given as it is ("absolute") and after removing one
/// constant of the model pair, estimated over the whole suite ("aligned"): a rotation and an origin
/// in the head's frame, and per landmark a place in the head's frame. "per clip" estimates the
/// constants for each clip alone; the translation then also has one scale per clip, since one
/// camera cannot tell a large far head from a small near one.
struct ClipScore {
  std::string name;
  int frames = 0;     ///< of the truth with the head in the picture
  int tracked = 0;    ///< of those
  int lost = 0;       ///< of those: said to be lost, or missing in the track
  int unflagged = 0;  ///< said to be tracked, though wrong: aligned pose by more than 10 degrees or
                      ///< absolute landmarks (all_68) by more than 15 %; absent frames count too
  int absent = 0;     ///< frames with the head out of the picture (not in any error figure)
  Spread rotation_absolute_deg, rotation_aligned_deg, rotation_per_clip_deg;
  /// In percent of the true distance between camera and head.
  Spread translation_absolute_percent, translation_aligned_percent, translation_per_clip_percent;
  LandmarkScore landmarks_absolute_percent, landmarks_aligned_percent;
  /// Where the true head turns slower than 6 deg/s and moves slower than 30 mm/s: deviation of the
  /// error from one frame to the next, divided by sqrt(2). NaN without such frames.
  double rotation_jitter_deg, translation_jitter_mm;
  int still_pairs = 0;  ///< pairs of frames behind the jitter
  /// Of the aligned pose; of the other parameters only where both sides have the same ones.
  Coverage rotation_coverage, translation_coverage, parameter_coverage;
};

struct SuiteScore {
  std::vector<ClipScore> clips;
  ClipScore overall;
  /// The constants that "aligned" removes: truth_model_from_track_model.
  Eigen::Quaterniond rotation_offset = Eigen::Quaterniond::Identity();
  Eigen::Vector3d origin_offset_m = Eigen::Vector3d::Zero();
};

/// Throws InvalidInput, naming the clip, where a truth has no frames, misses poses or landmarks, or
/// has another number of landmarks than the track.
SuiteScore score_tracks(const std::vector<ScoredClip>& clips);

/// Reads both files of one clip (track.jsonl and truth.jsonl).
ScoredClip read_scored_clip(const std::string& name, const std::string& track_path,
                            const std::string& truth_path);

/// The score as JSON text, and as a table for people.
std::string score_json(const SuiteScore& score);
std::string score_table(const SuiteScore& score);

}  // namespace semblance
