// Dots found in painted pictures, and where the centre of a disc falls, by counting rays.
#include "semblance/cameras/dots.h"

#include <gtest/gtest.h>

#include "painted_dots.h"

namespace semblance {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using testing::DotPaint;
using testing::DottedObject;
using testing::paint_dots;

Camera plain_camera() {
  Camera camera = Camera::centred(640, 480, 700.0);
  camera.camera_from_world = {};
  return camera;
}

/// Centroid and area of a disc's image by rays through a grid finer than the pixels.
DiscImage image_by_rays(const Camera& camera, const Disc& disc) {
  const Vector2d at = project(camera, disc.centre_m);
  const double reach = 1.2 * camera.focal_px.x() * disc.radius_m / disc.centre_m.z() + 2.0;
  constexpr int kSteps = 1500;
  const double step = 2.0 * reach / kSteps;
  Vector2d sum = Vector2d::Zero();
  int count = 0;
  for (int y = 0; y < kSteps; ++y) {
    for (int x = 0; x < kSteps; ++x) {
      const Vector2d pixel = at + Vector2d((x + 0.5) * step - reach, (y + 0.5) * step - reach);
      const Vector3d ray = unproject(camera, pixel);
      const Vector3d on_plane = ray * (disc.normal.dot(disc.centre_m) / disc.normal.dot(ray));
      if ((on_plane - disc.centre_m).norm() > disc.radius_m) continue;
      sum += pixel;
      ++count;
    }
  }
  return {sum / count, std::sqrt(count * step * step / std::numbers::pi)};
}

TEST(DiscImage, IsThatOfCountedRays) {
  for (const Lens lens : {Lens::pinhole, Lens::brown5}) {
    Camera camera = plain_camera();
    camera.lens = lens;
    if (lens == Lens::brown5) camera.distortion = {-0.25, 0.08, 1e-3, -1e-3, 0.0};
    const Disc disc{{0.09, -0.05, 0.4}, Vector3d(0.75, 0.3, -0.6).normalized(), 0.02};
    const DiscImage expected = image_by_rays(camera, disc), found = image_of(camera, disc);
    EXPECT_NEAR(found.centre_px.x(), expected.centre_px.x(), 2e-3) << lens_name(lens);
    EXPECT_NEAR(found.centre_px.y(), expected.centre_px.y(), 2e-3) << lens_name(lens);
    EXPECT_NEAR(found.radius_px, expected.radius_px, 5e-3) << lens_name(lens);
    // What the correction is for.
    EXPECT_GT(centre_offset_px(camera, disc).norm(), 0.3);
  }
}

TEST(DiscImage, FacingTheCameraHasNoOffset) {
  const Disc disc{{0.0, 0.0, 0.5}, {0.0, 0.0, -1.0}, 0.03};
  EXPECT_LT(centre_offset_px(plain_camera(), disc).norm(), 1e-12);
}

/// Dots found on a head, against the truth.
struct Found {
  int discs = 0, matched = 0, spurious = 0;
  double square_corrected = 0.0, square_plain = 0.0;  // of both coordinates
  double normalised = 0.0;                            // sum of e' C^-1 e
};

Found find_on(const DottedObject& object, const DotPaint& paint, std::uint64_t seed) {
  const Camera camera = plain_camera();
  const Rigid3 pose = testing::view_of({0.2, 0.1, 0.05}, {0.0, 0.0, 0.4});
  const std::vector<Dot> dots = find_dots(paint_dots(camera, object, pose, paint, seed));
  Found found;
  for (const Disc& disc : object.discs) found.discs += testing::faces(disc, pose, 0.4);
  for (const Dot& dot : dots) {
    const int index = testing::disc_at(object, camera, pose, dot.centre_px);
    if (index < 0) {
      ++found.spurious;
      continue;
    }
    const Disc& disc = object.discs[static_cast<std::size_t>(index)];
    if (!testing::faces(disc, pose, 0.4)) continue;
    ++found.matched;
    const Disc seen{pose * disc.centre_m, pose.rotation * disc.normal, disc.radius_m};
    const Vector2d plain = dot.centre_px - project(camera, seen.centre_m);
    const Vector2d corrected = plain - centre_offset_px(camera, seen);
    found.square_plain += plain.squaredNorm();
    found.square_corrected += corrected.squaredNorm();
    found.normalised += corrected.dot(dot.covariance_px2.inverse() * corrected);
    EXPECT_EQ(dot.light, paint.dot > paint.object);
  }
  return found;
}

TEST(FindDots, DarkAndLightOnesOnAHead) {
  Random random(4);
  const DottedObject object = testing::dotted_head(random, 60, 0.02);
  for (const bool light : {false, true}) {
    DotPaint paint;
    if (light) paint = {.dot = 0.9, .object = 0.15, .background = 0.3};
    const Found found = find_on(object, paint, 5);
    EXPECT_GT(found.discs, 8);
    EXPECT_EQ(found.matched, found.discs) << (light ? "light" : "dark");
    EXPECT_EQ(found.spurious, 0) << (light ? "light" : "dark");
    EXPECT_LT(std::sqrt(found.square_corrected / (2.0 * found.matched)), 0.05);
  }
}

TEST(FindDots, DeviationsAreThoseOfTheNoise) {
  Random random(9);
  const DottedObject object = testing::dotted_head(random, 60, 0.02);
  double normalised = 0.0;
  int count = 0;
  for (int i = 0; i < 8; ++i) {
    const Found found = find_on(object, {.noise = 0.02}, static_cast<std::uint64_t>(100 + i));
    normalised += found.normalised;
    count += found.matched;
  }
  ASSERT_GT(count, 80);
  // 2 on average for errors of the stated covariance. The residuals hold what blur makes of the
  // outline too, so that deviations err on the large side, less than twofold.
  EXPECT_LT(normalised / count, 2.5);
  EXPECT_GT(normalised / count, 0.5);
}

TEST(FindDots, ColouredDotsOfTheGroundsGreyLevel) {
  // Red and green of the same luma: only the colours show the dot.
  Rgb8 image{64, 64, {}};
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      int inside = 0;
      for (int k = 0; k < 64; ++k) {
        inside += std::hypot(x + (k % 8 + 0.5) / 8 - 30.3, y + (k / 8 + 0.5) / 8 - 33.8) < 9.0;
      }
      const auto level = [&](int dot, int ground) {
        return static_cast<std::uint8_t>(ground + (dot - ground) * inside / 64);
      };
      for (const std::uint8_t value : {level(180, 60), level(60, 121), level(60, 60)}) {
        image.data.push_back(value);
      }
    }
  }
  const std::vector<Dot> dots = find_dots(image);
  ASSERT_EQ(dots.size(), 1u);
  EXPECT_NEAR(dots[0].centre_px.x(), 30.3, 0.05);
  EXPECT_NEAR(dots[0].centre_px.y(), 33.8, 0.05);
}

TEST(FindDots, NothingInAnEvenPicture) {
  EXPECT_TRUE(find_dots({40, 30, std::vector<std::uint8_t>(3600, 128)}).empty());
  EXPECT_TRUE(find_dots({2, 2, std::vector<std::uint8_t>(12, 128)}).empty());
}

}  // namespace
}  // namespace semblance
