// What every Renderer must satisfy, for the tests of whoever adds one. Needs GoogleTest.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "semblance/core/errors.h"
#include "semblance/render/renderer.h"

namespace semblance {

/// How far two pictures of the same scene are apart.
struct FrameComparison {
  double largest_difference = 0.0;  // over the pixels that are not wrong
  int wrong_pixels = 0;
  int seen_pixels = 0;  // in the first frame
};

/// Pixels are wrong where the frames see different triangles, or where a colour or a component of
/// the normal differs by more than `tolerance`, or the depth by more than that share of itself.
/// Both frames need the channels triangle, depth, colour and normal and one size. A test then
/// bounds wrong_pixels: the two tolerances by which any two renderers agree.
inline FrameComparison compare_frames(const Frame& a, const Frame& b, double tolerance) {
  FrameComparison result;
  for (std::size_t i = 0; i < a.triangle.size(); ++i) {
    double difference = std::abs(a.depth.data[i] - b.depth.data[i]) /
                        std::max({a.depth.data[i], b.depth.data[i], 1e-9f});
    for (std::size_t c = 3 * i; c < 3 * i + 3; ++c) {
      difference = std::max({difference, std::abs(double{a.colour.data[c]} - b.colour.data[c]),
                             std::abs(double{a.normal.data[c]} - b.normal.data[c])});
    }
    result.seen_pixels += a.triangle[i] >= 0;
    if (a.triangle[i] != b.triangle[i] || !(difference <= tolerance))
      ++result.wrong_pixels;
    else
      result.largest_difference = std::max(result.largest_difference, difference);
  }
  return result;
}

namespace renderer_contract {

inline SceneObject triangle_object(const PointsF& corners) {
  auto mesh = std::make_shared<Mesh>();
  mesh->positions_m = corners.cast<double>();
  mesh->triangles.resize(1, 3);
  mesh->triangles << 0, 1, 2;
  SceneObject object;
  object.name = "triangle";
  object.mesh = mesh;
  object.positions_m = corners;
  vertex_normals(object.positions_m, mesh->triangles, object.normals);
  return object;
}

/// A camera at the origin that looks along -z, and triangles at the given depths.
inline Scene triangle_scene(float z0, float z1, float z2) {
  PointsF corners(3, 3);
  corners << -0.3f, -0.2f, -z0, 0.4f, -0.1f, -z1, 0.05f, 0.35f, -z2;
  Scene scene;
  scene.background = {0.1f, 0.2f, 0.3f};
  scene.objects.push_back(triangle_object(corners));
  return scene;
}

inline bool same(const Frame& a, const Frame& b) {
  return a.width == b.width && a.height == b.height && a.colour.data == b.colour.data &&
         a.depth.data == b.depth.data && a.triangle == b.triangle &&
         a.barycentric.data == b.barycentric.data && a.normal.data == b.normal.data &&
         a.mask == b.mask;
}

inline int seen(const Frame& frame) {
  return static_cast<int>(
      std::count_if(frame.triangle.begin(), frame.triangle.end(), [](int t) { return t >= 0; }));
}

inline void check_sees_nothing(Renderer& renderer, const Scene& scene, const Camera& camera) {
  const Frame frame = renderer.render(scene, camera, Channel::all);
  EXPECT_EQ(seen(frame), 0);
  for (std::size_t i = 0; i < frame.triangle.size(); ++i) {
    ASSERT_EQ(frame.depth.data[i], 0.0f);
    ASSERT_EQ(frame.mask[i], 0);
    for (int c = 0; c < 3; ++c) {
      ASSERT_FLOAT_EQ(frame.colour.data[3 * i + c], scene.background[c]);
      ASSERT_EQ(frame.normal.data[3 * i + c], 0.0f);
      ASSERT_EQ(frame.barycentric.data[3 * i + c], 0.0f);
    }
  }
}

inline void check_channels(Renderer& renderer, const Scene& scene, const Camera& camera) {
  const std::size_t count = static_cast<std::size_t>(camera.width) * camera.height;
  for (const Channel one : {Channel::colour, Channel::depth, Channel::triangle,
                            Channel::barycentric, Channel::normal, Channel::mask, Channel::all}) {
    SCOPED_TRACE("channels " + std::to_string(static_cast<unsigned>(one)));
    const Frame frame = renderer.render(scene, camera, one);
    EXPECT_EQ(frame.width, camera.width);
    EXPECT_EQ(frame.height, camera.height);
    EXPECT_EQ(frame.colour.data.size(), has(one, Channel::colour) ? 3 * count : 0);
    EXPECT_EQ(frame.depth.data.size(), has(one, Channel::depth) ? count : 0);
    EXPECT_EQ(frame.triangle.size(), has(one, Channel::triangle) ? count : 0);
    EXPECT_EQ(frame.barycentric.data.size(), has(one, Channel::barycentric) ? 3 * count : 0);
    EXPECT_EQ(frame.normal.data.size(), has(one, Channel::normal) ? 3 * count : 0);
    EXPECT_EQ(frame.mask.size(), has(one, Channel::mask) ? count : 0);
  }
}

inline void check_pixels(const Frame& frame) {
  for (std::size_t i = 0; i < frame.triangle.size(); ++i) {
    ASSERT_EQ(frame.mask[i] != 0, frame.triangle[i] >= 0);
    ASSERT_EQ(frame.mask[i] != 0, frame.depth.data[i] > 0.0f);
    if (frame.mask[i] == 0) continue;
    const float* b = &frame.barycentric.data[3 * i];
    const float* n = &frame.normal.data[3 * i];
    ASSERT_NEAR(b[0] + b[1] + b[2], 1.0f, 1e-5f);
    ASSERT_GT(std::min({b[0], b[1], b[2]}), -1e-3f);
    ASSERT_NEAR(n[0] * n[0] + n[1] * n[1] + n[2] * n[2], 1.0f, 1e-4f);
  }
}

inline void check(Renderer& renderer) {
  Camera camera = Camera::centred(90, 70, 100.0);
  const Scene scene = triangle_scene(0.8f, 1.0f, 1.3f);
  const Frame frame = renderer.render(scene, camera, Channel::all);
  EXPECT_GT(seen(frame), 500) << "the triangle is not drawn";
  check_pixels(frame);
  EXPECT_TRUE(same(frame, renderer.render(scene, camera, Channel::all))) << "not deterministic";
  EXPECT_TRUE(same(frame, renderer.clone()->render(scene, camera, Channel::all)));
  EXPECT_EQ(renderer.clone()->name(), renderer.name());
  check_channels(renderer, scene, camera);

  Scene turned = scene;  // back faces are drawn like front faces
  auto mesh = std::make_shared<Mesh>(*scene.objects[0].mesh);
  mesh->triangles << 0, 2, 1;
  turned.objects[0].mesh = mesh;
  EXPECT_EQ(renderer.render(turned, camera, Channel::mask).mask, frame.mask);

  Scene empty;
  empty.background = {0.4f, 0.5f, 0.6f};
  check_sees_nothing(renderer, empty, camera);
  check_sees_nothing(renderer, triangle_scene(-0.8f, -1.0f, -1.3f), camera);
  check_sees_nothing(renderer, triangle_scene(0.8f, -1.0f, 1.3f), camera);  // through the camera

  camera.lens = Lens::brown5;
  EXPECT_THROW(renderer.render(scene, camera, Channel::all), InvalidInput);
  camera.lens = Lens::pinhole;
  turned.objects[0].positions_m.conservativeResize(2, 3);
  EXPECT_THROW(renderer.render(turned, camera, Channel::all), InvalidInput);
}

}  // namespace renderer_contract
}  // namespace semblance

/// Deterministic, clones equal, channels asked for filled and others empty, an empty scene and
/// surfaces behind the camera unseen, wrong input refused.
#define EXPECT_RENDERER_CONTRACT(renderer)                     \
  do {                                                         \
    SCOPED_TRACE("contract of renderer " + (renderer).name()); \
    ::semblance::renderer_contract::check(renderer);           \
  } while (false)
