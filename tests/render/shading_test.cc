#include "semblance/render/shading.h"

#include <gtest/gtest.h>

#include "kernels.h"
#include "scenes.h"
#include "semblance/core/errors.h"
#include "semblance/core/random.h"

namespace semblance {
namespace {

constexpr int count = 1003;  // not a multiple of eight

PixelList random_list(Random& random, double lower, double upper) {
  PixelList list(count);
  for (float& value : list) value = static_cast<float>(random.uniform(lower, upper));
  return list;
}

TEST(Shading, InterpolatesVertexAttributes) {
  Random random(1);
  const SceneObject grid = testing::make_grid(
      "grid", 9, 7, [](float u, float v) { return Eigen::Vector3f(u, v, 0.0f); });
  VertexRows rows = VertexRows::NullaryExpr(
      grid.positions_m.rows(), 4, [&] { return static_cast<float>(random.uniform(-1, 1)); });
  VisiblePixels pixels;
  constexpr int first_triangle = 1000;
  for (int i = 0; i < count; ++i) {
    const double b1 = random.uniform();
    pixels.pixel.push_back(i);
    pixels.triangle.push_back(first_triangle + random.integer(2 * 9 * 7));
    pixels.b1.push_back(static_cast<float>(b1));
    pixels.b2.push_back(static_cast<float>(random.uniform() * (1 - b1)));
    pixels.depth_m.push_back(1.0f);
  }
  std::array<PixelList, 3> out;  // three of four columns
  interpolate(pixels, *grid.mesh, first_triangle, rows, out);
  for (int i = 0; i < count; ++i) {
    const auto corners = grid.mesh->triangles.row(pixels.triangle[i] - first_triangle);
    const Eigen::RowVector4d expected =
        (1.0 - pixels.b1[i] - pixels.b2[i]) * rows.row(corners[0]).cast<double>() +
        pixels.b1[i] * rows.row(corners[1]).cast<double>() +
        pixels.b2[i] * rows.row(corners[2]).cast<double>();
    for (int k = 0; k < 3; ++k) ASSERT_NEAR(out[k][i], expected[k], 1e-6);
  }
}

TEST(Shading, SamplesTexturesAsImagesAreSampled) {
  Random random(2);
  const auto texture = testing::make_texture(37, 23);
  PixelList u = random_list(random, -0.2, 1.2), v = random_list(random, -0.2, 1.2);
  u[5] = std::nanf(""), v[9] = 1e30f, u[11] = -1e30f;
  std::array<PixelList, 3> rgb;
  sample_texture(*texture, u, v, rgb);
  for (int i = 0; i < count; ++i) {
    std::array<float, 3> expected;
    sample_bilinear(*texture, u[i] * 37.0f, (1.0f - v[i]) * 23.0f, expected.data());
    for (int c = 0; c < 3; ++c) ASSERT_NEAR(rgb[c][i], expected[c], 1e-5) << i;
  }
  EXPECT_THROW(sample_texture(Image(4, 4, 4), u, v, rgb), InvalidInput);
}

TEST(Shading, TheLowerLeftTexelIsAtTheOrigin) {
  Image texture(2, 2, 3);
  texture.pixel(0, 1)[0] = 1.0f;  // bottom row, left
  std::array<PixelList, 3> rgb;
  sample_texture(texture, {0.25f, 0.75f, 0.25f}, {0.25f, 0.25f, 0.75f}, rgb);
  EXPECT_EQ(rgb[0], (PixelList{1.0f, 0.0f, 0.0f}));
}

TEST(Shading, LightsWithSphericalHarmonics) {
  Random random(3);
  const ShLight light = testing::make_light();
  std::array<PixelList, 3> normal, rgb;
  for (PixelList& list : normal) list = random_list(random, -1, 1);
  normal[0][4] = normal[1][4] = normal[2][4] = 0.0f;
  normalize(normal[0], normal[1], normal[2]);
  EXPECT_EQ(normal[0][4], 0.0f);
  for (PixelList& list : rgb) list = random_list(random, 0, 1);
  const std::array<PixelList, 3> albedo = rgb;
  apply_light(light, normal, rgb);
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3f n(normal[0][i], normal[1][i], normal[2][i]);
    ASSERT_NEAR(n.norm(), i == 4 ? 0.0f : 1.0f, 1e-6);
    const auto basis = sh_basis(n.x(), n.y(), n.z());
    for (int c = 0; c < 3; ++c) {
      double sum = 0;
      for (int k = 0; k < 9; ++k) sum += double{light.coefficients[k][c]} * basis[k];
      ASSERT_NEAR(rgb[c][i], albedo[c][i] * sum, 1e-6);
    }
  }
}

TEST(Shading, PortableAndWideKernelsGiveTheSameBits) {
  Random random(4);
  const auto texture = testing::make_texture(19, 31);
  const PixelList u = random_list(random, -0.1, 1.1), v = random_list(random, -0.1, 1.1);
  std::array<PixelList, 3> normal, results[2];
  for (PixelList& list : normal) list = random_list(random, -1, 1);
  for (int which = 0; which < 2; ++which) {
    const Kernels& kernels = which == 0 ? portable_kernels() : best_kernels();
    auto& rgb = results[which];
    rgb.fill(PixelList(count));
    auto n = normal;
    kernels.normalize(count, n[0].data(), n[1].data(), n[2].data());
    kernels.sample({count,
                    u.data(),
                    v.data(),
                    texture->data.data(),
                    19,
                    31,
                    {rgb[0].data(), rgb[1].data(), rgb[2].data()}});
    LightArgs args{count,
                   {n[0].data(), n[1].data(), n[2].data()},
                   {},
                   {rgb[0].data(), rgb[1].data(), rgb[2].data()}};
    for (int k = 0; k < 9; ++k)
      for (float& value : args.coefficients[k]) value = 0.1f * static_cast<float>(k) - 0.3f;
    kernels.light(args);
  }
  EXPECT_EQ(results[0], results[1]);
}

}  // namespace
}  // namespace semblance
