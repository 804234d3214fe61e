#include "semblance/cost/observation.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "semblance/core/errors.h"

namespace semblance {

float encode_intensity(float linear) { return std::sqrt(std::max(linear, 0.0f)); }

namespace {

ObservationLevel make_level(const Image& linear, double scale) {
  ObservationLevel level;
  level.width = linear.width;
  level.height = linear.height;
  level.scale = scale;
  const int w = linear.width, h = linear.height;
  std::vector<float>& encoded = level.encoded;
  encoded.resize(std::size_t{4} * w * h);
  for (std::size_t i = 0; i < static_cast<std::size_t>(w) * h; ++i) {
    for (int c = 0; c < 3; ++c) encoded[4 * i + c] = encode_intensity(linear.data[3 * i + c]);
    encoded[4 * i + 3] = 0.0f;
  }
  level.gradient.resize(std::size_t{8} * w * h);
  for (int y = 0; y < h; ++y) {
    const float* row = encoded.data() + std::size_t{4} * y * w;
    const float* above = encoded.data() + std::size_t{4} * std::max(y - 1, 0) * w;
    const float* below = encoded.data() + std::size_t{4} * std::min(y + 1, h - 1) * w;
    float* out = level.gradient.data() + std::size_t{8} * y * w;
    for (int x = 0; x < w; ++x, out += 8) {
      const float* left = row + 4 * std::max(x - 1, 0);
      const float* right = row + 4 * std::min(x + 1, w - 1);
      for (int c = 0; c < 4; ++c) {
        out[c] = 0.5f * (right[c] - left[c]);
        out[4 + c] = 0.5f * (below[4 * x + c] - above[4 * x + c]);
      }
    }
  }
  return level;
}

}  // namespace

Observation make_observation(Image linear_rgb, int level_count) {
  if (linear_rgb.channels != 3 || linear_rgb.width < 8 || linear_rgb.height < 8) {
    throw InvalidInput("an image to compare with needs 3 channels and at least 8 x 8 pixels, got " +
                       std::to_string(linear_rgb.width) + " x " +
                       std::to_string(linear_rgb.height) + " with " +
                       std::to_string(linear_rgb.channels));
  }
  Observation out;
  out.linear = std::move(linear_rgb);
  if (level_count > 0) out.levels.push_back(make_level(out.linear, 1.0));
  Image smaller = out.linear;
  for (int i = 1; i < level_count; ++i) {
    smaller = downsample_half(smaller);
    out.levels.push_back(make_level(smaller, std::pow(0.5, i)));
  }
  return out;
}

}  // namespace semblance
