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
  const Eigen::Index w = linear.width, h = linear.height;
  level.encoded.resize(4, w * h);
  const Eigen::Map<const Eigen::Array3Xf> colours(linear.data.data(), 3, w * h);
  level.encoded.topRows<3>() = colours.max(0.0f).sqrt();
  level.encoded.row(3).setZero();

  level.gradient.resize(8, w * h);
  for (Eigen::Index y = 0; y < h; ++y) {
    const Eigen::Index row = y * w;
    const Eigen::Index above = std::max<Eigen::Index>(y - 1, 0) * w;
    const Eigen::Index below = std::min(y + 1, h - 1) * w;
    for (Eigen::Index x = 0; x < w; ++x) {
      const Eigen::Index left = row + std::max<Eigen::Index>(x - 1, 0);
      const Eigen::Index right = row + std::min(x + 1, w - 1);
      auto out = level.gradient.col(row + x);
      out.head<4>() = 0.5f * (level.encoded.col(right) - level.encoded.col(left));
      out.tail<4>() = 0.5f * (level.encoded.col(below + x) - level.encoded.col(above + x));
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
  Image smaller;
  for (int i = 0; i < level_count; ++i) {
    if (i > 0) smaller = downsample_half(i == 1 ? out.linear : smaller);
    out.levels.push_back(make_level(i == 0 ? out.linear : smaller, std::pow(0.5, i)));
  }
  return out;
}

}  // namespace semblance
