// The markers of the lips, drawn over what the camera saw.
#pragma once

#include <deque>

#include "semblance/io/video.h"
#include "semblance/lips/lip_estimate.h"

namespace semblance {

/// Paints frames in their order: contours, trails of the last frames, and each marker with its
/// number; outer contour yellow, inner one blue, bridged markers as open orange rings. Pictures are
/// enlarged by a whole number to at least 1200 pixels of width.
class LipPainter {
 public:
  Rgb8 paint(const Rgb8& source, const LipEstimate& estimate);
  static int scale(int source_width);

 private:
  std::deque<LipEstimate> earlier_;
};

}  // namespace semblance
