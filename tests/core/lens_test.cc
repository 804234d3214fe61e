#include "semblance/core/lens.h"

#include <gtest/gtest.h>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <vector>

#include "semblance/core/random.h"

namespace semblance {
namespace {

struct LensCase {
  Lens lens;
  LensCoefficients coefficients;
  double reach;  // largest |direction| tried
};

std::string case_name(const ::testing::TestParamInfo<LensCase>& info) {
  return std::string(lens_name(info.param.lens));
}

Eigen::Vector2d distort_with_opencv(const LensCase& lens, const Eigen::Vector2d& direction) {
  const std::vector<cv::Point3d> points{{direction.x(), direction.y(), 1.0}};
  const cv::Vec3d zero(0.0, 0.0, 0.0);
  const cv::Matx33d unit = cv::Matx33d::eye();
  std::vector<cv::Point2d> image;
  const LensCoefficients& k = lens.coefficients;
  if (lens.lens == Lens::fisheye) {
    cv::fisheye::projectPoints(points, image, zero, zero, unit, cv::Vec4d(k[0], k[1], k[2], k[3]));
  } else {
    cv::projectPoints(points, zero, zero, unit, std::vector<double>(k.begin(), k.end()), image);
  }
  return {image[0].x, image[0].y};
}

class Lenses : public ::testing::TestWithParam<LensCase> {
 protected:
  // A random direction within the lens's reach.
  Eigen::Vector2d direction() {
    const double angle = random_.uniform(0.0, 6.283), length = random_.uniform(0.0, 1.0);
    return GetParam().reach * length * Eigen::Vector2d(std::cos(angle), std::sin(angle));
  }
  Random random_{7};
};

TEST_P(Lenses, AgreeWithOpencv) {
  const LensCase& lens = GetParam();
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector2d point = direction();
    const Eigen::Vector2d ours = distort(lens.lens, lens.coefficients, point).point;
    EXPECT_LT((ours - distort_with_opencv(lens, point)).norm(), 1e-13);
  }
}

TEST_P(Lenses, DerivativesAreThoseOfDifferences) {
  const LensCase& lens = GetParam();
  constexpr double step = 1e-6;
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector2d point = direction();
    const LensPoint here = distort(lens.lens, lens.coefficients, point);
    for (int axis = 0; axis < 2; ++axis) {
      const Eigen::Vector2d shift = step * Eigen::Vector2d::Unit(axis);
      const Eigen::Vector2d difference =
          (distort(lens.lens, lens.coefficients, point + shift).point -
           distort(lens.lens, lens.coefficients, point - shift).point) /
          (2.0 * step);
      EXPECT_LT((difference - here.d_direction.col(axis)).norm(), 1e-8);
    }
    for (int k = 0; k < coefficient_count(lens.lens); ++k) {
      LensCoefficients more = lens.coefficients, less = lens.coefficients;
      more[static_cast<std::size_t>(k)] += step;
      less[static_cast<std::size_t>(k)] -= step;
      const Eigen::Vector2d difference =
          (distort(lens.lens, more, point).point - distort(lens.lens, less, point).point) /
          (2.0 * step);
      EXPECT_LT((difference - here.d_coefficients.col(k)).norm(), 1e-8 * (1.0 + point.norm()))
          << coefficient_name(lens.lens, k);
    }
  }
}

TEST_P(Lenses, UndistortFindsTheDirection) {
  const LensCase& lens = GetParam();
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector2d point = direction();
    const Eigen::Vector2d image = distort(lens.lens, lens.coefficients, point).point;
    const Eigen::Vector2d found = undistort(lens.lens, lens.coefficients, image);
    EXPECT_LT((found - point).norm(), 1e-10 * (1.0 + point.squaredNorm()));
  }
}

TEST_P(Lenses, AreFoundByName) {
  EXPECT_EQ(lens_from_name(lens_name(GetParam().lens)), GetParam().lens);
}

INSTANTIATE_TEST_SUITE_P(
    All, Lenses,
    ::testing::Values(LensCase{Lens::pinhole, {}, 2.0}, LensCase{Lens::brown2, {-0.25, 0.05}, 0.8},
                      LensCase{Lens::brown5, {-0.28, 0.09, 1.2e-3, -0.7e-3, -0.01}, 0.8},
                      LensCase{Lens::brown8, {0.6, -0.3, 1e-3, -4e-4, 0.02, 0.9, -0.2, 0.01}, 0.8},
                      LensCase{Lens::fisheye, {-0.02, 0.01, -0.006, 0.001}, 6.0}),
    case_name);

TEST(Lens, UnknownNameHasNoLens) { EXPECT_FALSE(lens_from_name("brown6")); }

TEST(Lens, FisheyeShowsNothingBeyondItsFold) {
  // theta (1 - 0.4 theta^2) never exceeds 0.609, as the slope vanishes at theta = 0.913.
  const LensCoefficients folded{-0.4};
  EXPECT_TRUE(undistort(Lens::fisheye, folded, {0.60, 0.0}).allFinite());
  EXPECT_FALSE(undistort(Lens::fisheye, folded, {0.62, 0.0}).allFinite());
}

TEST(Lens, FisheyeShowsNoDirectionBesideTheCamera) {
  // Without coefficients the distance is the angle itself; 90 degrees are 1.5708.
  EXPECT_TRUE(undistort(Lens::fisheye, {}, {1.56, 0.0}).allFinite());
  EXPECT_FALSE(undistort(Lens::fisheye, {}, {1.58, 0.0}).allFinite());
}

}  // namespace
}  // namespace semblance
