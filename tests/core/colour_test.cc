#include <gtest/gtest.h>

#include "semblance/core/conventions.h"

namespace semblance {
namespace {

TEST(Colour, KnownValuesOfTheStandard) {
  EXPECT_FLOAT_EQ(linear_from_srgb(0.0f), 0.0f);
  EXPECT_FLOAT_EQ(linear_from_srgb(1.0f), 1.0f);
  EXPECT_NEAR(linear_from_srgb(0.5f), 0.21404114f, 1e-6f);
  EXPECT_NEAR(srgb_from_linear(0.18f), 0.46135613f, 1e-6f);
  EXPECT_FLOAT_EQ(linear_from_srgb(0.02f), 0.02f / 12.92f);
}

TEST(Colour, EveryByteSurvivesTheRoundTrip) {
  for (int byte = 0; byte < 256; ++byte) {
    EXPECT_NEAR(srgb_from_linear(linear_from_srgb(byte / 255.0f)) * 255.0f, byte, 0.01f);
  }
}

TEST(Colour, EncodingClamps) {
  EXPECT_EQ(srgb_from_linear(-1.0f), 0.0f);
  EXPECT_FLOAT_EQ(srgb_from_linear(7.0f), 1.0f);
}

TEST(Conventions, HalfPixelConversionsAreInverse) {
  const Eigen::Vector2d first_centre_px(0.5, 0.5);
  EXPECT_EQ(integer_centred_from_ours(first_centre_px), Eigen::Vector2d::Zero());
  EXPECT_EQ(ours_from_integer_centred(integer_centred_from_ours({3.25, -1.0})),
            Eigen::Vector2d(3.25, -1.0));
}

}  // namespace
}  // namespace semblance
