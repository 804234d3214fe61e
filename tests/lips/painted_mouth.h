// Pictures of dots with exactly known places, drawn without anything of the tracker.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "semblance/core/image.h"
#include "semblance/core/random.h"
#include "semblance/io/video.h"

namespace semblance::testing {

/// The 16 markers' places, in half widths of the mouth, for lips that are `open` apart (0 to 1).
inline std::vector<Eigen::Vector2d> mouth_shape(double open) {
  const double up = 0.12 * open, down = 0.5 * open;
  return {{-1.0, 0.0},   {-0.38, -0.36 - up}, {0.0, -0.33 - up},  {0.38, -0.36 - up},
          {1.0, 0.0},    {0.4, 0.42 + down},  {0.0, 0.46 + down}, {-0.4, 0.42 + down},
          {-0.76, 0.01}, {-0.36, -0.14 - up}, {0.0, -0.12 - up},  {0.36, -0.14 - up},
          {0.76, 0.01},  {0.37, 0.14 + down}, {0.0, 0.17 + down}, {-0.37, 0.14 + down}};
}

/// Turned by `roll_rad`, `half_width_px` wide to each side of `middle_px`.
inline std::vector<Eigen::Vector2d> place_mouth(const std::vector<Eigen::Vector2d>& shape,
                                                const Eigen::Vector2d& middle_px,
                                                double half_width_px, double roll_rad) {
  Eigen::Matrix2d turn;
  turn << std::cos(roll_rad), -std::sin(roll_rad), std::sin(roll_rad), std::cos(roll_rad);
  std::vector<Eigen::Vector2d> out;
  for (const Eigen::Vector2d& p : shape) out.push_back(middle_px + half_width_px * (turn * p));
  return out;
}

struct DotPaint {
  double radius_px = 2.5;
  Eigen::Vector3f colour{0.03f, 0.1f, 0.35f};
  Eigen::Vector3f ground{0.5f, 0.3f, 0.24f};
  double noise_levels = 2.0;  // deviation, of 255
};

/// Part of a pixel that discs cover, from 8 x 8 samples.
inline float disc_share(int x, int y, const std::vector<Eigen::Vector2d>& places_px,
                        double radius_px) {
  constexpr int kSamples = 8;
  const Eigen::Vector2d corner(x, y), middle = corner.array() + 0.5;
  int covered = 0;
  for (const Eigen::Vector2d& c : places_px) {
    if ((middle - c).norm() > radius_px + 1.0) continue;
    for (int k = 0; k < kSamples * kSamples; ++k) {
      const Eigen::Vector2d p = corner + Eigen::Vector2d(k % kSamples + 0.5, k / kSamples + 0.5) /
                                             static_cast<double>(kSamples);
      covered += (p - c).squaredNorm() < radius_px * radius_px ? 1 : 0;
    }
  }
  return std::min(1.0f, static_cast<float>(covered) / (kSamples * kSamples));
}

/// Discs on a ground with a slow shading, and noise in the 8-bit picture.
inline Image paint_dots(int width, int height, const std::vector<Eigen::Vector2d>& places_px,
                        const DotPaint& paint, std::uint64_t seed) {
  Image linear(width, height, 3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const float share = disc_share(x, y, places_px, paint.radius_px);
      const float shade = 1.0f + 0.2f * static_cast<float>(x) / static_cast<float>(width);
      const Eigen::Vector3f colour = shade * (share * paint.colour + (1.0f - share) * paint.ground);
      std::copy_n(colour.data(), 3, linear.pixel(x, y));
    }
  }
  Rgb8 picture = rgb8_from_linear(linear);
  Random random(seed);
  for (std::uint8_t& value : picture.data) {
    const double noisy = value + paint.noise_levels * random.normal();
    value = static_cast<std::uint8_t>(std::clamp(std::lround(noisy), 0l, 255l));
  }
  return linear_from_rgb8(picture);
}

}  // namespace semblance::testing
