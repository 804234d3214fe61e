// The wireframe of a mouth drawn over pictures.
#pragma once

#include <string>

#include "semblance/io/video.h"
#include "semblance/models/mouth_wireframe.h"

namespace semblance {

/// Lines of the four contours and of the muscle's fibres, dots for the markers, and a line of text.
/// Small pictures are enlarged by overlay_scale.
class MouthWireOverlay {
 public:
  MouthWireOverlay(const MouthWireframe& wireframe, int source_width, int source_height);
  int width() const { return scale_ * source_width_; }
  int height() const { return scale_ * source_height_; }

  Rgb8 paint(const Rgb8& source, const MouthPoints& markers, const std::string& text);

 private:
  MouthWireframe wireframe_;
  int source_width_, source_height_, scale_;
  MouthPoints points_px_;
};

}  // namespace semblance
