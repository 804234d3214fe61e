// The result of tracking, semblance.track/1: JSON Lines (docs/formats/track.md).
#pragma once

#include <Eigen/Core>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "semblance/core/camera.h"
#include "semblance/optim/parameter_space.h"

namespace semblance {

enum class TrackStatus { tracked, lost, reinitialised };
std::string to_string(TrackStatus status);

struct TrackHeader {
  std::string kind;  // "face" or "lips"
  std::uint64_t seed = 1;
  ParameterSpace parameters;
  std::vector<Camera> cameras;
  int width = 0, height = 0;
  std::vector<std::string> landmark_names;
  nlohmann::json config;  // everything needed to run again
};

/// One line. A lost frame has no estimate: no x, sigma, pose, landmarks. No parameters, no pose.
struct TrackFrame {
  int frame = 0;
  double time_s = 0.0;
  TrackStatus status = TrackStatus::lost;
  Eigen::VectorXd x;
  Eigen::VectorXd sigma;  // one per entry of x; NaN (written null) where there is none
  Eigen::Vector4d rotation_wxyz = Eigen::Vector4d::Zero();
  Eigen::Vector3d translation_m = Eigen::Vector3d::Zero();
  double residual_rms = 0.0;
  double inlier_fraction = 0.0;
  std::vector<Eigen::Vector2d> landmarks_px;
  nlohmann::json extra;  // a pipeline's own fields, merged into the line; null or an object
};

/// Appends lines to DIR/track.jsonl and flushes each, so that a crash keeps what was done.
class TrackWriter {
 public:
  /// Starts a new file with its header line.
  TrackWriter(const std::string& path, const TrackHeader& header);
  /// Goes on after the last whole line of an existing file: a torn last line is cut off.
  static TrackWriter append(const std::string& path);
  TrackWriter(TrackWriter&&) noexcept;
  ~TrackWriter();
  void write(const TrackFrame& frame);

 private:
  struct Impl;
  explicit TrackWriter(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

struct Track {
  nlohmann::json header;
  std::vector<TrackFrame> frames;
};
/// Reads a result file; a torn last line is ignored, any other damage throws InvalidInput naming
/// the line.
Track read_track(const std::string& path);

/// One row per frame, one column per parameter with unit, sigma, pose and landmark (RFC 4180).
void write_track_csv(const std::string& path, const Track& track);

}  // namespace semblance
