// Video files.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "semblance/core/image.h"

namespace semblance {

struct VideoInfo {
  std::string path;
  int width = 0, height = 0;
  double frames_per_second = 0.0;
  int frame_count = 0;  // as the container says; 0 when it does not
};

/// 8-bit sRGB, RGB order, rows from the top: what a video holds, before linearisation.
struct Rgb8 {
  int width = 0, height = 0;
  std::vector<std::uint8_t> data;
};

/// Linear RGB of an 8-bit image (table look-up).
Image linear_from_rgb8(const Rgb8& image);
Rgb8 rgb8_from_linear(const Image& image);

/// Frames of a video in order. A folder of images (sorted by name) is a video too.
class VideoSource {
 public:
  /// Throws InvalidInput (not a video, no frames, no size) or IoError (cannot be opened).
  explicit VideoSource(const std::string& path);
  ~VideoSource();
  VideoSource(VideoSource&&) noexcept;

  const VideoInfo& info() const;
  /// The next frame; false at the end. Throws InvalidInput naming the frame when the file ends in
  /// the middle of one or delivers fewer frames than it declares by more than two.
  bool next(Rgb8& frame);
  /// Continues with frame `index` (decodes up to it, so that every frame is the same as in a run
  /// from the start).
  void skip_to(int index);
  /// Number of the frame that `next` will deliver.
  int position() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Writes a video (H.264 in .mp4, MJPG in .avi; 8-bit 4:2:0 in the matrix of BT.601) under a
/// temporary name until `close`. Uses one thread, and the same frames make the same bytes. Pictures
/// of odd size get a copy of their last column or row.
///
/// Throws InvalidInput for a name, size, rate or frame that does not fit, and IoError, naming the
/// file, where it cannot be written or no encoder can be started.
class VideoWriter {
 public:
  VideoWriter(const std::string& path, int width, int height, double frames_per_second);
  ~VideoWriter();  // without close(): the temporary file is removed
  void write(const Rgb8& frame);
  void close();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace semblance
