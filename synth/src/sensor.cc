#include "semblance/synth/sensor.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "semblance/core/conventions.h"

namespace semblance {
namespace {

/// Normal deviates by Box and Muller (1958), both of each pair: half a million per frame are drawn.
class NormalPairs {
 public:
  /// Seed and stream are mixed first: neighbouring seeds must not give shifted copies.
  NormalPairs(std::uint64_t seed, std::uint64_t stream) : state_(seed) {
    state_ = mix() ^ stream;
    state_ = mix();
  }
  float next() {
    if (has_second_) {
      has_second_ = false;
      return second_;
    }
    const std::uint64_t bits = mix();
    const float u = (static_cast<float>(bits >> 40) + 1.0f) * 0x1p-24f;
    const float angle =
        static_cast<float>((bits >> 8) & 0xffffffu) * 0x1p-24f * 2 * std::numbers::pi_v<float>;
    const float radius = std::sqrt(-2 * std::log(u));
    second_ = radius * std::sin(angle);
    has_second_ = true;
    return radius * std::cos(angle);
  }

 private:
  // SplitMix64 (Steele, Lea and Flood 2014).
  std::uint64_t mix() {
    std::uint64_t z = (state_ += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }
  std::uint64_t state_;
  float second_ = 0;
  bool has_second_ = false;
};

}  // namespace

void blur_gaussian(Image& image, double sigma_px) {
  if (sigma_px <= 0 || image.empty()) return;
  cv::Mat view(image.height, image.width, CV_32FC(image.channels), image.data.data());
  const int half = std::max(1, static_cast<int>(std::ceil(4 * sigma_px)));
  cv::GaussianBlur(view, view, cv::Size(2 * half + 1, 2 * half + 1), sigma_px, sigma_px,
                   cv::BORDER_REFLECT);
}

Rgb8 expose(const Image& linear_rgb, const SensorSpec& sensor, std::uint64_t seed, int frame) {
  constexpr int kSteps = 4096;  // of the tone table, interpolated between; finer than 0.1 level
  static_assert(kSteps > 256);
  std::vector<float> tone(kSteps + 2);
  for (int i = 0; i < kSteps + 2; ++i) {
    // Indexed by the square root of the light, where the sRGB curve is nearly straight.
    const float root = std::min(1.0f, static_cast<float>(i) / kSteps);
    tone[i] =
        255.0f * std::pow(srgb_from_linear(root * root), static_cast<float>(sensor.tone_gamma));
  }
  Rgb8 out{linear_rgb.width, linear_rgb.height, {}};
  out.data.resize(linear_rgb.data.size());
  NormalPairs noise(seed, static_cast<std::uint64_t>(frame) << 32);
  const float levels = static_cast<float>(sensor.noise_levels);
  for (std::size_t i = 0; i < linear_rgb.data.size(); ++i) {
    const float place = kSteps * std::sqrt(std::clamp(linear_rgb.data[i], 0.0f, 1.0f));
    const int cell = static_cast<int>(place);
    float value = tone[cell] + (tone[cell + 1] - tone[cell]) * (place - static_cast<float>(cell));
    if (levels > 0) value += levels * noise.next();
    out.data[i] = static_cast<std::uint8_t>(std::clamp(value + 0.5f, 0.0f, 255.0f));
  }
  return out;
}

}  // namespace semblance
