// An observed image prepared for comparison.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "semblance/core/image.h"

namespace semblance {

/// Comparison happens on the square root of linear intensity: shot noise and the eye are about even
/// on that scale, and the root of albedo times light is the product of roots.
float encode_intensity(float linear);

/// One level of an image pyramid. Derivatives are central differences at the pixel's centre
/// (one-sided ones stall the solver at 0.4 px).
struct ObservationLevel {
  int width = 0, height = 0;
  double scale = 1.0;  // pixels of this level per pixel of the full image
  Eigen::Array<float, 4, Eigen::Dynamic> encoded;   // encoded red, green, blue, 0 of each pixel
  Eigen::Array<float, 8, Eigen::Dynamic> gradient;  // derivatives per pixel in x, 0, in y, 0

  const float* colour(int pixel) const { return encoded.data() + std::size_t{4} * pixel; }
};

/// Pyramid of an image: level 0 is the full size, each further one half.
struct Observation {
  Image linear;
  std::vector<ObservationLevel> levels;
};

/// A count of 0 keeps the image alone. Throws InvalidInput unless it has 3 channels and 8 x 8
/// pixels.
Observation make_observation(Image linear_rgb, int level_count);

}  // namespace semblance
