#include "sharp_outline.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>

namespace semblance {
namespace {

constexpr int kSamples = 16;
constexpr float kStep_px = 0.5f, kReach_px = 0.5f * kStep_px * kSamples;
constexpr int kPlateau = 5;             // samples at each end that show one side alone
constexpr float kLeastContrast = 3.0f;  // in deviations within the sides
constexpr float kFarthest_px = 2.0f;

/// Linear colour, bilinear.
Eigen::Vector3f colour_at(const ObservationLevel& image, const Eigen::Vector2f& at) {
  const float x = std::clamp(at.x() - 0.5f, 0.0f, static_cast<float>(image.width) - 1.001f),
              y = std::clamp(at.y() - 0.5f, 0.0f, static_cast<float>(image.height) - 1.001f);
  const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
  const float fx = x - static_cast<float>(x0), fy = y - static_cast<float>(y0);
  const auto pixel = [&](int dx, int dy) -> Eigen::Array3f {
    return image.encoded.col((y0 + dy) * image.width + x0 + dx).head<3>().square();
  };
  return ((1.0f - fy) * ((1.0f - fx) * pixel(0, 0) + fx * pixel(1, 0)) +
          fy * ((1.0f - fx) * pixel(0, 1) + fx * pixel(1, 1)))
      .matrix();
}

void sharpen(ContourTarget& target, const ObservationLevel& observation, float least_sigma_px) {
  Eigen::Matrix<float, 3, kSamples> colours;
  for (int i = 0; i < kSamples; ++i) {
    const float t = (static_cast<float>(i) + 0.5f) * kStep_px - kReach_px;
    colours.col(i) = colour_at(observation, target.target_px + t * target.normal);
  }
  const Eigen::Vector3f inside = colours.leftCols<kPlateau>().rowwise().mean(),
                        outside = colours.rightCols<kPlateau>().rowwise().mean();
  const Eigen::Vector3f difference = outside - inside;
  const float contrast = difference.norm();
  if (!(contrast > 1e-4f)) return;
  const Eigen::Matrix<float, 1, kSamples> along = difference.transpose() / contrast * colours;
  const auto spread = [](const auto& values) {
    return (values.array() - values.mean()).square().mean();
  };
  const float deviation =
      std::sqrt(0.5f * (spread(along.leftCols<kPlateau>()) + spread(along.rightCols<kPlateau>())));
  if (contrast < kLeastContrast * deviation) return;
  const float missing =
      (1.0f - (along.array() - difference.dot(inside) / contrast) / contrast).sum() * kStep_px;
  const float shift_px = missing - kReach_px;
  if (std::abs(shift_px) > kFarthest_px) return;
  target.target_px += shift_px * target.normal;
  // Errors of the sides are alike over a few samples.
  target.sigma_px = std::hypot(least_sigma_px, 2.0f * deviation / contrast);
}

}  // namespace

void sharpen_outline(std::vector<ContourTarget>& outline, const ObservationLevel& observation,
                     double least_sigma_px) {
  for (ContourTarget& target : outline) {
    sharpen(target, observation, static_cast<float>(least_sigma_px));
  }
}

}  // namespace semblance
