#include "semblance/render/visibility.h"

#include <gmock/gmock.h>

#include <cmath>
#include <thread>

#include "scenes.h"
#include "semblance/core/errors.h"
#include "semblance/core/random.h"

namespace semblance {
namespace {

using testing::make_object;
using testing::NamedScene;
using testing::Triangles;

VisiblePixels visible(const Scene& scene, const Camera& camera, const PixelRect* region = nullptr) {
  VisiblePixels pixels;
  Rasteriser().visible_pixels(scene, camera, region, pixels);
  return pixels;
}

bool same(const VisiblePixels& a, const VisiblePixels& b) {
  return a.pixel == b.pixel && a.triangle == b.triangle && a.b1 == b.b1 && a.b2 == b.b2 &&
         a.depth_m == b.depth_m;
}

/// Corners of every triangle of a scene in the camera frame, in double.
std::vector<std::array<Eigen::Vector3d, 3>> camera_triangles(const NamedScene& named) {
  std::vector<std::array<Eigen::Vector3d, 3>> all;
  for (const SceneObject& object : named.scene.objects) {
    for (Eigen::Index t = 0; t < object.mesh->triangle_count(); ++t) {
      all.emplace_back();
      for (int c = 0; c < 3; ++c) {
        const Eigen::Vector3d world =
            object.positions_m.row(object.mesh->triangles(t, c)).cast<double>().transpose();
        all.back()[c] = named.camera.camera_from_world * world;
      }
    }
  }
  return all;
}

bool in_front(const std::array<Eigen::Vector3d, 3>& p) {
  return p[0].z() > 1e-3 && p[1].z() > 1e-3 && p[2].z() > 1e-3;
}

/// Where a ray from the camera with direction d, d.z = 1, meets a triangle: depth and barycentrics
/// by Cramer's rule.
bool intersect(const Eigen::Vector3d& d, const std::array<Eigen::Vector3d, 3>& p, double& depth) {
  Eigen::Matrix3d system;
  system << p[1] - p[0], p[2] - p[0], -d;
  const double determinant = system.determinant();
  if (determinant == 0.0) return false;
  const Eigen::Vector3d solution = system.inverse() * -p[0];
  depth = solution.z();
  return solution.x() >= 0 && solution.y() >= 0 && solution.x() + solution.y() <= 1 && depth > 1e-3;
}

class Catalogue : public ::testing::TestWithParam<int> {
 protected:
  static const NamedScene& scene() {
    static const std::vector<NamedScene> scenes = testing::scene_catalogue();
    return scenes[GetParam()];
  }
};
INSTANTIATE_TEST_SUITE_P(Visibility, Catalogue, ::testing::Range(0, 7));

TEST_P(Catalogue, SeesWhatRaysSee) {
  const NamedScene& named = scene();
  const auto triangles = camera_triangles(named);
  const VisiblePixels pixels = visible(named.scene, named.camera);
  std::vector<int> seen(named.camera.width * named.camera.height, -1);
  for (std::size_t i = 0; i < pixels.size(); ++i) seen[pixels.pixel[i]] = pixels.triangle[i];
  // As many pixels, spread evenly, as brute force has time for.
  const std::size_t stride = 1 + seen.size() * triangles.size() / 4'000'000;
  int wrong = 0, checked = 0;
  for (std::size_t i = 0; i < seen.size(); i += stride) {
    const double x = static_cast<double>(i % named.camera.width) + 0.5;
    const double y = static_cast<double>(i / named.camera.width) + 0.5;
    const Eigen::Vector3d ray = unproject(named.camera, {x, y});
    int first = -1;
    double nearest = 1e9, depth = 0;
    for (std::size_t t = 0; t < triangles.size(); ++t) {
      if (!in_front(triangles[t]) || !intersect(ray, triangles[t], depth) || depth >= nearest)
        continue;
      nearest = depth, first = static_cast<int>(t);
    }
    wrong += first != seen[i];
    ++checked;
  }
  EXPECT_LE(wrong, std::ceil(named.wrong_share * checked)) << named.name;
}

TEST_P(Catalogue, BarycentricsAndDepthAreThoseOfThePixelsCentre) {
  const NamedScene& named = scene();
  const auto triangles = camera_triangles(named);
  const VisiblePixels pixels = visible(named.scene, named.camera);
  ASSERT_GT(pixels.size(), 1000u);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const double b1 = pixels.b1[i], b2 = pixels.b2[i];
    ASSERT_GE(b1, 0.0);
    ASSERT_GE(b2, 0.0);
    ASSERT_LE(b1 + b2, 1.0 + 1e-6);
    const auto& p = triangles[pixels.triangle[i]];
    const Eigen::Vector3d point = (1 - b1 - b2) * p[0] + b1 * p[1] + b2 * p[2];
    const Eigen::Vector2d centre(pixels.pixel[i] % named.camera.width + 0.5,
                                 pixels.pixel[i] / named.camera.width + 0.5);
    // Vertices are rounded to 1/1024 pixel. Floats of distant vertices are coarser, and a thin
    // triangle's linear functions lose digits in proportion to its length over its breadth.
    const Eigen::Vector2d q[3] = {project(named.camera, p[0]), project(named.camera, p[1]),
                                  project(named.camera, p[2])};
    const double farthest_px = std::max({q[0].norm(), q[1].norm(), q[2].norm()});
    const Eigen::Vector2d u = q[1] - q[0], v = q[2] - q[0];
    const double length_px = std::max({u.norm(), v.norm(), (u - v).norm()});
    const double breadth_px = std::abs(u.x() * v.y() - u.y() * v.x()) / length_px;
    const double tolerance_px =
        1.5e-3 + 1e-6 * farthest_px + 2e-7 * length_px * length_px / std::max(breadth_px, 1e-9);
    ASSERT_LT((project(named.camera, point) - centre).norm(), tolerance_px)
        << named.name << " " << i;
    ASSERT_NEAR(pixels.depth_m[i], point.z(), 2e-4 * point.z()) << named.name << " " << i;
  }
}

TEST_P(Catalogue, AllInstructionsGiveTheSameBits) {
  const VisiblePixels best = visible(scene().scene, scene().camera);
  for (const auto instructions :
       {Rasteriser::Instructions::portable, Rasteriser::Instructions::avx2}) {
    VisiblePixels other;
    Rasteriser(instructions).visible_pixels(scene().scene, scene().camera, nullptr, other);
    EXPECT_TRUE(same(other, best));
  }
}

TEST_P(Catalogue, FrontFacesHideWhatLiesBehindThemAndBackFacesNothing) {
  const auto triangles = camera_triangles(scene());
  const auto seen_from_front = [&](std::int32_t t) {
    const auto& p = triangles[t];
    return (p[1] - p[0]).cross(p[2] - p[0]).dot(p[0]) < 0.0;
  };
  VisiblePixels front, portable;
  const auto list = [&](Rasteriser::Instructions instructions, VisiblePixels& out) {
    Rasteriser(instructions, Rasteriser::Faces::front)
        .visible_pixels(scene().scene, scene().camera, nullptr, out);
  };
  list(Rasteriser::Instructions::best, front);
  list(Rasteriser::Instructions::portable, portable);
  EXPECT_TRUE(same(front, portable));
  std::vector<std::int32_t> triangle_at(
      std::size_t{1} * scene().camera.width * scene().camera.height, -1);
  for (std::size_t i = 0; i < front.size(); ++i) {
    EXPECT_TRUE(seen_from_front(front.triangle[i])) << scene().name << " " << i;
    triangle_at[front.pixel[i]] = front.triangle[i];
  }
  const VisiblePixels all = visible(scene().scene, scene().camera);
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (!seen_from_front(all.triangle[i])) continue;
    EXPECT_EQ(triangle_at[all.pixel[i]], all.triangle[i]) << scene().name << " " << i;
  }
}

TEST_P(Catalogue, ARegionIsThatPartOfTheWhole) {
  const PixelRect region{33, 41, 118, 97};
  const VisiblePixels whole = visible(scene().scene, scene().camera);
  VisiblePixels expected;
  for (std::size_t i = 0; i < whole.size(); ++i) {
    const int x = whole.pixel[i] % scene().camera.width, y = whole.pixel[i] / scene().camera.width;
    if (x < region.x0 || x >= region.x1 || y < region.y0 || y >= region.y1) continue;
    expected.pixel.push_back(whole.pixel[i]);
    expected.triangle.push_back(whole.triangle[i]);
    expected.depth_m.push_back(whole.depth_m[i]);
  }
  const VisiblePixels part = visible(scene().scene, scene().camera, &region);
  EXPECT_EQ(part.pixel, expected.pixel);
  EXPECT_EQ(part.triangle, expected.triangle);
  EXPECT_THAT(part.depth_m, ::testing::Pointwise(::testing::FloatNear(1e-5f), expected.depth_m));
}

TEST_P(Catalogue, ReusedBuffersDoNotLeak) {
  const std::vector<NamedScene> scenes = testing::scene_catalogue();
  Rasteriser rasteriser;
  VisiblePixels pixels;
  for (const NamedScene& other : scenes)
    rasteriser.visible_pixels(other.scene, other.camera, nullptr, pixels);
  rasteriser.visible_pixels(scene().scene, scene().camera, nullptr, pixels);
  EXPECT_TRUE(same(pixels, visible(scene().scene, scene().camera)));
}

TEST_P(Catalogue, ProjectsVerticesAsTheCameraDoes) {
  Rasteriser rasteriser;
  VisiblePixels pixels;
  const NamedScene& named = scene();
  rasteriser.visible_pixels(named.scene, named.camera, nullptr, pixels);
  const std::span<const float> projected = rasteriser.projected_vertices();
  std::size_t v = 0;
  for (const SceneObject& object : named.scene.objects) {
    for (Eigen::Index i = 0; i < object.positions_m.rows(); ++i, ++v) {
      const Eigen::Vector3d point = named.camera.camera_from_world *
                                    Eigen::Vector3d(object.positions_m.row(i).cast<double>());
      if (point.z() <= 1e-3) {
        ASSERT_FALSE(std::isfinite(projected[3 * v]));
        continue;
      }
      const Eigen::Vector2d px = project(named.camera, point);
      const double tolerance = 1e-4 + 1e-6 * px.norm() / std::min(1.0, point.z());
      ASSERT_NEAR(projected[3 * v], px.x(), tolerance);
      ASSERT_NEAR(projected[3 * v + 1], px.y(), tolerance);
      ASSERT_NEAR(projected[3 * v + 2], point.z(), 1e-6);
    }
  }
  EXPECT_EQ(projected.size(), 3 * v);
}

/// A camera for which the point (x, -y, -1) lies at pixel (x, y).
Camera pixel_camera(int width, int height) {
  Camera camera = Camera::centred(width, height, 1.0);
  camera.principal_px.setZero();
  return camera;
}

/// How often each pixel is covered when the triangles are drawn one by one.
std::vector<int> coverage(const SceneObject& object, const Camera& camera) {
  std::vector<int> count(camera.width * camera.height, 0);
  Rasteriser rasteriser;
  VisiblePixels pixels;
  for (Eigen::Index t = 0; t < object.mesh->triangle_count(); ++t) {
    auto mesh = std::make_shared<Mesh>(*object.mesh);
    mesh->triangles = object.mesh->triangles.middleRows(t, 1);
    Scene scene;
    scene.objects = {object};
    scene.objects[0].mesh = mesh;
    rasteriser.visible_pixels(scene, camera, nullptr, pixels);
    for (const int pixel : pixels.pixel) ++count[pixel];
  }
  return count;
}

/// A grid of random cells that covers the image; vertices at multiples of `step_px`.
SceneObject random_grid(int columns, int rows, const Camera& camera, double step_px,
                        std::uint64_t seed) {
  Random random(seed);
  return testing::make_grid("cover", columns, rows, [&](float u, float v) {
    const bool border = u == 0 || u == 1 || v == 0 || v == 1;
    const double jitter = border ? 0.0 : 0.15;  // never turns a triangle over
    const double x = (u * 1.2 - 0.1) * camera.width +
                     jitter * random.uniform(-1, 1) * 1.2 * camera.width / columns;
    const double y = (v * 1.2 - 0.1) * camera.height +
                     jitter * random.uniform(-1, 1) * 1.2 * camera.height / rows;
    return Eigen::Vector3f(static_cast<float>(std::round(x / step_px) * step_px),
                           static_cast<float>(-std::round(y / step_px) * step_px), -1.0f);
  });
}

TEST(Watertight, EveryPixelOfARandomGridIsCoveredOnce) {
  const Camera camera = pixel_camera(64, 48);
  for (const auto& [columns, rows] : {std::pair{24, 20}, {5, 3}, {2, 30}}) {  // small, large, both
    for (const double step_px : {1.0 / 4096, 0.5}) {  // 0.5: edges and vertices on pixel centres
      const SceneObject grid = random_grid(columns, rows, camera, step_px, 7);
      EXPECT_THAT(coverage(grid, camera), ::testing::Each(1))
          << columns << " x " << rows << " cells, vertices on multiples of " << step_px;
    }
  }
}

TEST(Watertight, EveryPixelOfARandomSubdivisionIsCoveredOnce) {
  const Camera camera = pixel_camera(64, 48);
  Random random(11);
  std::vector<Eigen::RowVector3f> points{{-9, 9, -1}, {75, 9, -1}, {75, -60, -1}, {-9, -60, -1}};
  std::vector<Eigen::RowVector3i> triangles{{0, 1, 2}, {0, 2, 3}};
  while (triangles.size() < 500) {  // splits of any triangle: large ones beside slivers
    const int t = random.integer(static_cast<int>(triangles.size()));
    const Eigen::RowVector3i old = triangles[t];
    const double a = random.uniform(), b = random.uniform() * (1 - a);
    points.emplace_back(points[old[0]] * static_cast<float>(1 - a - b) +
                        points[old[1]] * static_cast<float>(a) +
                        points[old[2]] * static_cast<float>(b));
    const int centre = static_cast<int>(points.size()) - 1;
    triangles[t] = {old[0], old[1], centre};
    triangles.push_back({old[1], old[2], centre});
    triangles.push_back({old[2], old[0], centre});
  }
  PointsF positions(points.size(), 3);
  for (std::size_t i = 0; i < points.size(); ++i) positions.row(i) = points[i];
  Triangles corners(triangles.size(), 3);
  for (std::size_t i = 0; i < triangles.size(); ++i) corners.row(i) = triangles[i];
  // Rounding a thin triangle's corners may turn it over; then a pixel is covered by it and by both
  // of its neighbours. Never by none.
  const std::vector<int> count = coverage(make_object("split", positions, corners), camera);
  int once = 0;
  for (const int n : count) {
    EXPECT_GE(n, 1);
    EXPECT_EQ(n % 2, 1);
    once += n == 1;
  }
  EXPECT_GE(once, 0.99 * count.size());
}

TEST(Visibility, TheLowerTriangleWinsATie) {
  PointsF positions(3, 3);
  positions << -0.2f, -0.2f, -1.0f, 0.3f, -0.1f, -1.1f, 0.0f, 0.3f, -0.9f;
  Triangles triangles(12, 3);
  for (int t = 0; t < 12; ++t) triangles.row(t) << 0, 1, 2;
  Scene scene;
  scene.objects = {make_object("same", positions, triangles)};
  for (const double focal_px : {40.0, 400.0}) {  // small and large triangles
    const VisiblePixels pixels = visible(scene, Camera::centred(100, 100, focal_px));
    EXPECT_GT(pixels.size(), 20u);
    EXPECT_THAT(pixels.triangle, ::testing::Each(0));
  }
}

TEST(Visibility, SurvivesExtremeAndBrokenPositions) {
  PointsF positions(9, 3);
  positions << -1e9f, 0.0f, -1.0f, 1e9f, 0.1f, -1.0f, 0.0f, 1e9f, -1.0f,  //
      -3e3f, -3e3f, -1.0f, 3e3f, -3e3f, -1.0f, 0.0f, 3e3f, -1.0f,         //
      0.0f, 0.0f, -1.0f, std::nanf(""), 0.1f, -1.0f, 0.1f, 0.0f, -1.0f;
  Triangles triangles(3, 3);
  triangles << 0, 1, 2, 3, 4, 5, 6, 7, 8;
  Scene scene;
  scene.objects = {make_object("extreme", positions, triangles)};
  const VisiblePixels pixels = visible(scene, Camera::centred(50, 40, 100.0));
  EXPECT_EQ(pixels.size(), 2000u);  // the second triangle covers the image
  EXPECT_THAT(pixels.triangle, ::testing::Each(1));
}

TEST(Visibility, EmptyInputsSeeNothing) {
  EXPECT_EQ(visible({}, Camera::centred(10, 10, 10)).size(), 0u);
  const auto scenes = testing::scene_catalogue();
  const PixelRect nowhere{50, 50, 50, 60}, outside{500, 0, 600, 100};
  EXPECT_EQ(visible(scenes[0].scene, scenes[0].camera, &nowhere).size(), 0u);
  EXPECT_EQ(visible(scenes[0].scene, scenes[0].camera, &outside).size(), 0u);
}

TEST(Visibility, RefusesWhatItCannotDraw) {
  auto named = testing::scene_catalogue()[0];
  named.camera.lens = Lens::brown5;
  EXPECT_THROW(visible(named.scene, named.camera), InvalidInput);
  named.camera.lens = Lens::pinhole;
  named.camera.width = 0;
  EXPECT_THROW(visible(named.scene, named.camera), InvalidInput);
  named.camera.width = 100;
  named.scene.objects[0].positions_m.conservativeResize(5, 3);
  EXPECT_THROW(visible(named.scene, named.camera), InvalidInput);
  named.scene.objects[0].mesh = nullptr;
  EXPECT_THROW(visible(named.scene, named.camera), InvalidInput);
}

TEST(Visibility, OneRasteriserPerThread) {
  const std::vector<NamedScene> scenes = testing::scene_catalogue();
  std::vector<VisiblePixels> results(4 * scenes.size());
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&, i] {
      Rasteriser rasteriser;
      for (std::size_t k = 0; k < scenes.size(); ++k)
        rasteriser.visible_pixels(scenes[k].scene, scenes[k].camera, nullptr,
                                  results[i * scenes.size() + k]);
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (std::size_t k = 0; k < results.size(); ++k)
    EXPECT_TRUE(same(results[k], results[k % scenes.size()]));
}

}  // namespace
}  // namespace semblance
