// Finds faces in an image, roughly.
#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "semblance/core/image.h"

namespace semblance {

/// A box around the inner face (brows to chin) in pixels of the full image.
struct FaceBox {
  double x_px = 0, y_px = 0, width_px = 0, height_px = 0;
  int votes = 0;  // windows that agreed
  /// Centres of the eyes, left in the image first, where both were found inside the box.
  std::optional<std::array<Eigen::Vector2d, 2>> eyes_px;

  /// The point between the eyes and their distance: seen, or where faces usually have them.
  Eigen::Vector2d eye_middle_px() const;
  double eye_distance_px() const;
};

/// Viola and Jones' cascades of Haar features (OpenCV's frontal face, alt2, and eye), the first run
/// on a reduced image. Only used to start: it knows frontal faces, to about a tenth of their width.
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
