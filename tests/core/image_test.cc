#include "semblance/core/image.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "semblance/core/random.h"

namespace semblance {
namespace {

Image random_image(int width, int height, int channels) {
  Image image(width, height, channels);
  Random random(7);
  for (float& value : image.data) value = static_cast<float>(random.uniform());
  return image;
}

float repeated(const Image& image, int x, int y, int c) {
  return image.pixel(std::min(x, image.width - 1), std::min(y, image.height - 1))[c];
}

TEST(Image, DownsampleAveragesBlocksOfFour) {
  for (const int channels : {1, 2, 3, 4}) {
    for (const auto& [width, height] : {std::pair{8, 6}, {7, 5}, {1, 1}, {1, 4}, {33, 2}}) {
      const Image image = random_image(width, height, channels);
      const Image half = downsample_half(image);
      ASSERT_EQ(half.width, (width + 1) / 2);
      ASSERT_EQ(half.height, (height + 1) / 2);
      ASSERT_EQ(half.channels, channels);
      for (int y = 0; y < half.height; ++y) {
        for (int x = 0; x < half.width; ++x) {
          for (int c = 0; c < channels; ++c) {
            const float mean =
                0.25f *
                (repeated(image, 2 * x, 2 * y, c) + repeated(image, 2 * x + 1, 2 * y, c) +
                 repeated(image, 2 * x, 2 * y + 1, c) + repeated(image, 2 * x + 1, 2 * y + 1, c));
            ASSERT_NEAR(half.pixel(x, y)[c], mean, 1e-6f);
          }
        }
      }
    }
  }
}

TEST(Image, DownsampleOfNothingIsNothing) { EXPECT_TRUE(downsample_half(Image()).empty()); }

TEST(Image, BilinearAgreesWithOpencv) {
  const Image image = random_image(17, 11, 3);
  const cv::Mat source(image.height, image.width, CV_32FC3, const_cast<float*>(image.data.data()));
  Random random(3);
  for (int i = 0; i < 300; ++i) {
    const auto x = static_cast<float>(random.uniform(-2.0, 19.0));
    const auto y = static_cast<float>(random.uniform(-2.0, 13.0));
    float ours[3];
    sample_bilinear(image, x, y, ours);
    cv::Mat theirs;
    // OpenCV's pixel centres are integers, and its interpolation works in steps of 1/32 pixel.
    cv::remap(source, theirs, cv::Mat(1, 1, CV_32FC2, cv::Scalar(x - 0.5f, y - 0.5f)), {},
              cv::INTER_LINEAR, cv::BORDER_REPLICATE);
    for (int c = 0; c < 3; ++c) ASSERT_NEAR(ours[c], theirs.at<cv::Vec3f>(0, 0)[c], 2.0f / 32.0f);
  }
}

TEST(Image, BilinearIsExactOnAPlane) {
  Image image(9, 7, 1);
  for (int y = 0; y < 7; ++y) {
    for (int x = 0; x < 9; ++x) *image.pixel(x, y) = 2.0f * (x + 0.5f) - 3.0f * (y + 0.5f);
  }
  for (float y = 0.5f; y <= 6.5f; y += 0.3f) {
    for (float x = 0.5f; x <= 8.5f; x += 0.3f) {
      float value = 0.0f;
      sample_bilinear(image, x, y, &value);
      ASSERT_NEAR(value, 2.0f * x - 3.0f * y, 1e-4f);
    }
  }
}

TEST(Image, BilinearRepeatsTheBorderAndSurvivesNan) {
  const Image image = random_image(4, 3, 1);
  float value = -1.0f;
  sample_bilinear(image, 100.0f, 100.0f, &value);
  EXPECT_EQ(value, *image.pixel(3, 2));
  sample_bilinear(image, -100.0f, -100.0f, &value);
  EXPECT_EQ(value, *image.pixel(0, 0));
  const float nan = std::numeric_limits<float>::quiet_NaN();
  sample_bilinear(image, nan, nan, &value);
  EXPECT_EQ(value, *image.pixel(0, 0));
}

}  // namespace
}  // namespace semblance
