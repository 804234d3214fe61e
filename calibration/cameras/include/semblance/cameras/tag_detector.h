// AprilTags of the family tag36h11, with borders 1 or 2 bits wide.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "semblance/io/video.h"

namespace semblance {

struct TagSettings {
  int border_bits = 1;       // black border; Kalibr's sheets have 2 in some versions
  float decimate = 1.0f;     // quads are searched in a picture that is smaller by this
  bool refine_edges = true;  // fits the outline's lines to the gradients afterwards
};

struct FoundTag {
  int id = 0;
  int wrong_bits = 0;                      // corrected ones
  Eigen::Matrix<double, 2, 4> corners_px;  // lower left, lower right, upper right, upper left
};

/// libapriltag behind a plain interface. One thread at a time.
class TagDetector {
 public:
  explicit TagDetector(const TagSettings& settings);
  ~TagDetector();
  TagDetector(TagDetector&&) noexcept;

  /// Every tag of an 8-bit grey picture of `width` pixels a row, none where a side has less
  /// than 32. An id may appear more than once.
  std::vector<FoundTag> detect(const std::uint8_t* grey, int width, int height);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace semblance
