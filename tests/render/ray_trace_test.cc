#include <gmock/gmock.h>

#include "scenes.h"
#include "semblance/core/errors.h"
#include "semblance/core/parallel.h"
#include "semblance/render/embree_renderer.h"

namespace semblance {
namespace {

/// A square of side 2 around `centre` spanned by the half-axes a and b, coloured 0.5.
SceneObject square(const Eigen::Vector3f& centre, const Eigen::Vector3f& a,
                   const Eigen::Vector3f& b) {
  SceneObject object = testing::make_grid("square", 1, 1, [&](float u, float v) {
    return Eigen::Vector3f(centre + (2 * u - 1) * a + (2 * v - 1) * b);
  });
  object.material.colour.setConstant(0.5f);
  return object;
}

constexpr int size = 41;
const float* middle(const Frame& frame) {
  return frame.colour.pixel(frame.width / 2, frame.height / 2);
}

class RayTrace : public ::testing::Test {
 protected:
  RayTrace() {
    // A wall that faces the camera at one metre.
    scene_.objects.push_back(square({0, 0, -1}, {50, 0, 0}, {0, 50, 0}));
  }
  Frame trace() { return ray_trace(scene_, camera_, Channel::all, options_); }

  Scene scene_;
  Camera camera_ = Camera::centred(size, size, 60.0);
  RayTraceOptions options_;
};

TEST_F(RayTrace, ALampLightsByTheCosine) {
  options_.lamp.emplace();
  options_.lamp->towards_light = {0, std::sqrt(3.0), 1};  // 60 degrees from the normal
  options_.lamp->radiance = {1.0f, 0.5f, 0.0f};
  const Frame frame = trace();
  EXPECT_NEAR(middle(frame)[0], 0.5 * (1 + 0.5), 1e-5);
  EXPECT_NEAR(middle(frame)[1], 0.5 * (1 + 0.25), 1e-5);
  EXPECT_NEAR(middle(frame)[2], 0.5, 1e-5);
}

TEST_F(RayTrace, ASurfaceBetweenCastsAShadow) {
  // Seen from the wall's middle the lamp is straight up the slope (0, 1, 1); the blocker lies
  // there, outside the picture.
  scene_.objects.push_back(square({0, 0.6f, -0.4f}, {0.1f, 0, 0}, {0, 0.1f, 0}));
  options_.lamp.emplace();
  options_.lamp->towards_light = {0, 1, 1};
  EXPECT_NEAR(middle(trace())[0], 0.5, 1e-5);
  options_.lamp->shadows = false;
  EXPECT_NEAR(middle(trace())[0], 0.5 * (1 + std::sqrt(0.5)), 1e-5);
}

TEST_F(RayTrace, OcclusionBesideATallWallIsOneHalf) {
  // The corner of two half-planes at a right angle: each hides half of the other's cosine-weighted
  // hemisphere (form factor 1/2). The second wall starts a hair's breadth from the middle pixel.
  scene_.objects.push_back(square({-1e-3f, 0, -0.505f}, {0, 0, 0.495f}, {0, 50, 0}));
  camera_ = Camera::centred(3, 3, 60.0);
  options_.occlusion_rays = 20000;
  options_.occlusion_distance_m = 40.0;
  const Frame frame = trace();
  EXPECT_NEAR(middle(frame)[0], 0.25, 0.008);  // 4 sigma of the rays and the wall's end
  options_.occlusion_distance_m = 1e-4;        // nothing that near
  EXPECT_NEAR(middle(trace())[0], 0.5, 1e-5);
}

TEST_F(RayTrace, SamplesCoverThePixelEvenly) {
  // A wall that ends at x = 0.35 of the way across a pixel column.
  const double edge_px = 23.35;
  const auto edge_m = static_cast<float>((edge_px - 0.5 * size) / 60.0);
  scene_.objects = {square({edge_m - 50, 0, -1}, {50, 0, 0}, {0, 50, 0})};
  options_.samples_per_pixel = 256;
  const Frame frame = trace();
  EXPECT_NEAR(frame.colour.pixel(22, 7)[0], 0.5, 1e-6);
  EXPECT_NEAR(frame.colour.pixel(23, 7)[0], 0.5 * 0.35, 0.01);
  EXPECT_NEAR(frame.colour.pixel(24, 7)[0], 0.0, 1e-6);
  EXPECT_EQ(frame.mask[7 * size + 23], 0);  // the centre's view
  EXPECT_EQ(frame.mask[7 * size + 22], 1);
}

TEST_F(RayTrace, DependsOnTheSeedAndNotOnTheThreads) {
  auto named = testing::scene_catalogue()[6];
  options_.samples_per_pixel = 3;
  options_.occlusion_rays = 2;
  const auto draw = [&](int threads, std::uint64_t seed) {
    set_thread_count(threads);
    options_.seed = seed;
    Frame frame = ray_trace(named.scene, named.camera, Channel::all, options_);
    set_thread_count(0);
    return frame.colour.data;
  };
  const auto expected = draw(1, 5);
  EXPECT_EQ(draw(2, 5), expected);
  EXPECT_NE(draw(2, 6), expected);
}

TEST_F(RayTrace, RefusesOptionsOutOfRange) {
  options_.samples_per_pixel = 0;
  EXPECT_THROW(trace(), InvalidInput);
  options_ = {};
  options_.occlusion_rays = -1;
  EXPECT_THROW(trace(), InvalidInput);
  options_ = {};
  options_.occlusion_distance_m = std::nan("");
  EXPECT_THROW(trace(), InvalidInput);
  options_ = {};
  options_.lamp.emplace().towards_light.setZero();
  EXPECT_THROW(trace(), InvalidInput);
}

}  // namespace
}  // namespace semblance
