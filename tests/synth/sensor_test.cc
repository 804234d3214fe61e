#include "semblance/synth/sensor.h"

#include <gtest/gtest.h>

#include <cmath>

#include "semblance/core/conventions.h"

namespace semblance {
namespace {

TEST(SensorTest, BlurOfAPointIsTheGaussian) {
  constexpr double kSigma = 1.7;
  Image image(41, 41, 3);
  for (int c = 0; c < 3; ++c) image.pixel(20, 20)[c] = 1.0f;
  blur_gaussian(image, kSigma);
  // The sampled kernel is normalised by its sum.
  double sum = 0;
  for (int i = -20; i <= 20; ++i) sum += std::exp(-0.5 * i * i / (kSigma * kSigma));
  for (const auto& [x, y] : {std::pair{20, 20}, {22, 20}, {20, 17}, {24, 18}}) {
    const double dx = x - 20, dy = y - 20;
    const double expected = std::exp(-0.5 * (dx * dx + dy * dy) / (kSigma * kSigma)) / (sum * sum);
    EXPECT_NEAR(image.pixel(x, y)[1], expected, 2e-5) << x << " " << y;
  }
}

TEST(SensorTest, BlurKeepsAConstantPicture) {
  Image image(17, 9, 3, 0.3f);
  blur_gaussian(image, 2.5);
  for (const float value : image.data) EXPECT_NEAR(value, 0.3f, 1e-6);
}

TEST(SensorTest, NoiseOnAConstantPatchHasTheStatedDeviation) {
  SensorSpec sensor;
  sensor.noise_levels = 2.0;
  const Image grey(200, 150, 3, 0.2f);
  const Rgb8 picture = expose(grey, sensor, 5, 3);
  double sum = 0, squares = 0, neighbours = 0;
  for (std::size_t i = 0; i < picture.data.size(); ++i) {
    sum += picture.data[i];
    squares += static_cast<double>(picture.data[i]) * picture.data[i];
  }
  const double count = static_cast<double>(picture.data.size());
  const double mean = sum / count, variance = squares / count - mean * mean;
  for (std::size_t i = 1; i < picture.data.size(); ++i)
    neighbours += (picture.data[i] - mean) * (picture.data[i - 1] - mean);
  EXPECT_NEAR(mean, 255 * srgb_from_linear(0.2f), 0.03);
  // Rounding adds 1/12; the deviation of the estimate over 90,000 values is 0.5 %.
  EXPECT_NEAR(std::sqrt(variance), std::sqrt(4.0 + 1.0 / 12), 0.03);
  EXPECT_NEAR(neighbours / count / variance, 0.0, 0.015);
}

TEST(SensorTest, WithoutNoiseEveryLevelComesOutAsEncoded) {
  SensorSpec sensor;
  sensor.noise_levels = 0.0;
  Image ramp(256, 1, 3);
  for (int x = 0; x < 256; ++x)
    for (int c = 0; c < 3; ++c) ramp.pixel(x, 0)[c] = linear_from_srgb(static_cast<float>(x) / 255);
  const Rgb8 picture = expose(ramp, sensor, 1, 0);
  for (int x = 0; x < 256; ++x) EXPECT_EQ(picture.data[3 * x], x);
}

TEST(SensorTest, NoiseDiffersBetweenFramesAndSeeds) {
  const Image grey(64, 48, 3, 0.4f);
  const SensorSpec sensor;
  EXPECT_EQ(expose(grey, sensor, 1, 1).data, expose(grey, sensor, 1, 1).data);
  // Neighbouring seeds and frames must not be shifted copies either.
  const auto a = expose(grey, sensor, 1, 1).data;
  for (const auto& b : {expose(grey, sensor, 2, 1).data, expose(grey, sensor, 1, 2).data})
    for (std::size_t shift = 0; shift < 4; ++shift)
      EXPECT_FALSE(std::equal(a.begin() + static_cast<std::ptrdiff_t>(shift), a.end(), b.begin()));
}

}  // namespace
}  // namespace semblance
