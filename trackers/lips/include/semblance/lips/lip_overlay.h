// The markers of the lips, drawn over what the camera saw.
#pragma once

#include <deque>

#include "semblance/io/video.h"
#include "semblance/lips/lip_estimate.h"

namespace semblance {

/// Paints frames in their order: contours, trails of the last frames, and the markers; outer
/// contour yellow, inner one blue, bridged markers as open orange rings. Pictures are enlarged by a
/// whole number to at least 1200 pixels of width. A small mouth is shown again, larger and with the
/// markers' numbers, in an upper corner.
class LipPainter {
 public:
  Rgb8 paint(const Rgb8& source, const LipEstimate& estimate);
  static int scale(int source_width);

 private:
  void follow_mouth(const LipEstimate& estimate);
  void paint_inset(const Rgb8& source, const LipEstimate& estimate, Rgb8& picture) const;

  std::deque<LipEstimate> earlier_;
  Eigen::Vector2d mouth_px_ = Eigen::Vector2d::Zero();  // its middle, smoothed
  double mouth_width_px_ = 0.0;                         // smoothed; 0: not seen yet
};

}  // namespace semblance
