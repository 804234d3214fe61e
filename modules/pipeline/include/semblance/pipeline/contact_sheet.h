// The few pictures of a run that are worth keeping for its report.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "semblance/io/track_file.h"
#include "semblance/io/video.h"

namespace semblance {

/// A reduced picture of one frame.
struct Thumbnail {
  int frame = 0;
  double time_s = 0.0;
  TrackStatus status = TrackStatus::lost;
  double residual_rms = 0.0;
  int width = 0, height = 0;
  std::vector<std::uint8_t> jpeg;
};

/// Chooses, while frames arrive in order and without knowing how many will come: evenly spaced
/// ones, those that fit worst (one per passage of ten frames), and those where the state changes.
/// Keeps only reduced JPEG copies of its choice.
class ContactSheet {
 public:
  static constexpr int k_spaced = 24, k_worst = 12, k_changes = 12, k_passage_frames = 10;
  static constexpr int k_width_px = 360;

  /// `source_width_px`: width of the video that landmarks refer to, of which pictures are whole
  /// multiples; the worst frames are then cut to the head.
  explicit ContactSheet(int source_width_px = 0);
  ~ContactSheet();
  ContactSheet(ContactSheet&&) noexcept;
  ContactSheet& operator=(ContactSheet&&) noexcept;

  void add(const Rgb8& picture, const TrackFrame& track);

  /// 12 to 24 evenly spaced frames (all, if fewer), in order of time.
  std::vector<Thumbnail> spaced() const;
  /// Up to 12 frames with an estimate, the worst residual first.
  std::vector<Thumbnail> worst() const;
  /// The first 12 frames where tracking was lost or began anew, in order of time.
  std::vector<Thumbnail> changes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace semblance
