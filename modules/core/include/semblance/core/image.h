// An image: rows of interleaved float channels.
#pragma once

#include <cstddef>
#include <vector>

namespace semblance {

/// width x height pixels of `channels` floats each, rows from the top, channels interleaved.
/// Colour images are linear RGB in [0, 1] (core/conventions.h).
struct Image {
  int width = 0, height = 0, channels = 0;
  std::vector<float> data;

  Image() = default;
  Image(int width_in, int height_in, int channels_in, float value = 0.0f)
      : width(width_in),
        height(height_in),
        channels(channels_in),
        data(static_cast<std::size_t>(width_in) * height_in * channels_in, value) {}

  bool empty() const { return data.empty(); }
  float* pixel(int x, int y) {
    return data.data() + (static_cast<std::size_t>(y) * width + x) * channels;
  }
  const float* pixel(int x, int y) const {
    return data.data() + (static_cast<std::size_t>(y) * width + x) * channels;
  }
};

/// Half the size in each direction (rounded up), by a 2x2 box filter; borders are repeated.
Image downsample_half(const Image& image);
/// Bilinear value of every channel at (x_px, y_px) in our convention, clamped at the border.
void sample_bilinear(const Image& image, float x_px, float y_px, float* out);

}  // namespace semblance
