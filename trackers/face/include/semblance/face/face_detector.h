// Finds faces in an image, roughly.
#pragma once

#include <memory>
#include <vector>

#include "semblance/core/image.h"

namespace semblance {

/// A box around the inner face (brows to chin) in pixels of the full image.
struct FaceBox {
  double x_px = 0, y_px = 0, width_px = 0, height_px = 0;
  int votes = 0;  // windows that agreed
};

/// Viola and Jones' cascade of Haar features (OpenCV's frontal face, alt2), run on a reduced image.
/// Only used to start: it knows frontal faces, to about a tenth of their width.
class FaceDetector {
 public:
  /// Throws InvalidInput naming the places searched if the cascade file is not installed.
  FaceDetector();
  ~FaceDetector();
  /// All faces, largest first.
  std::vector<FaceBox> detect(const Image& linear_rgb) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace semblance
