#include "semblance/cost/texture_atlas.h"

#include <gtest/gtest.h>

#include <map>

#include "semblance/core/random.h"
#include "sheet.h"

namespace semblance {
namespace {

/// Two charts of random triangles that do not overlap: a jittered grid each.
Mesh make_charts() {
  Mesh mesh = *testing::make_sheet(6).mesh;
  Random random(3);
  const Mesh grid = mesh;
  const Eigen::Index n = grid.vertex_count(), t = grid.triangle_count();
  mesh.positions_m.resize(2 * n, 3);
  mesh.positions_m << grid.positions_m, grid.positions_m;
  mesh.triangles.resize(2 * t, 3);
  mesh.triangles << grid.triangles, (grid.triangles.array() + static_cast<int>(n)).matrix();
  mesh.uvs.resize(2 * n, 2);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (int chart = 0; chart < 2; ++chart) {
      const auto jitter = [&] { return static_cast<float>(random.uniform(-0.012, 0.012)); };
      mesh.uvs(chart * n + i, 0) =
          0.05f + 0.5f * static_cast<float>(chart) + 0.38f * grid.uvs(i, 0) + jitter();
      mesh.uvs(chart * n + i, 1) = 0.1f + 0.75f * grid.uvs(i, 1) + jitter();
    }
  }
  return mesh;
}

/// Barycentrics (b1, b2) of a point in a triangle's uvs.
Eigen::Vector2d barycentrics(const Mesh& mesh, Eigen::Index t, double u, double v) {
  const Eigen::Vector2d a = mesh.uvs.row(mesh.triangles(t, 0)).cast<double>();
  Eigen::Matrix2d edges;
  edges.col(0) = mesh.uvs.row(mesh.triangles(t, 1)).cast<double>().transpose() - a;
  edges.col(1) = mesh.uvs.row(mesh.triangles(t, 2)).cast<double>().transpose() - a;
  return edges.inverse() * (Eigen::Vector2d(u, v) - a);
}

double least(const Eigen::Vector2d& b) { return std::min({b[0], b[1], 1.0 - b[0] - b[1]}); }

struct AtlasTest : ::testing::Test {
  Mesh mesh = make_charts();
  int width = 97, height = 80;
  TextureAtlas atlas = make_texture_atlas(mesh, width, height);
  double u(int texel) const { return (texel % width + 0.5) / width; }
  double v(int texel) const { return 1.0 - (texel / width + 0.5) / height; }
};

TEST_F(AtlasTest, OwnsEveryTexelInsideATriangle) {
  std::map<int, std::size_t> entry;
  for (std::size_t i = 0; i < atlas.size(); ++i) entry[atlas.texel[i]] = i;
  ASSERT_EQ(entry.size(), atlas.size());
  int inside = 0;
  for (int texel = 0; texel < width * height; ++texel) {
    for (Eigen::Index t = 0; t < mesh.triangle_count(); ++t) {
      if (least(barycentrics(mesh, t, u(texel), v(texel))) <= 1e-6) continue;
      ++inside;
      ASSERT_TRUE(entry.count(texel)) << "texel " << texel << " of triangle " << t;
      const std::size_t i = entry[texel];
      const Eigen::Vector2d b = barycentrics(mesh, atlas.triangle[i], u(texel), v(texel));
      EXPECT_GE(least(b), -1e-5);
      EXPECT_NEAR(b[0], atlas.b1[i], 1e-5);
      EXPECT_NEAR(b[1], atlas.b2[i], 1e-5);
    }
  }
  EXPECT_GT(inside, width * height / 3);
}

TEST_F(AtlasTest, SurroundsChartsByABorderOnTheirEdge) {
  std::vector<bool> owned(static_cast<std::size_t>(width) * height, false);
  for (std::size_t i = 0; i < atlas.size(); ++i) {
    owned[atlas.texel[i]] = true;
    EXPECT_GE(atlas.b1[i], 0.0f);
    EXPECT_GE(atlas.b2[i], 0.0f);
    EXPECT_LE(atlas.b1[i] + atlas.b2[i], 1.0f + 1e-5f);
  }
  // All four texels of a bilinear look-up anywhere on the surface have a colour.
  Random random(5);
  for (int k = 0; k < 20000; ++k) {
    const int t = random.integer(static_cast<int>(mesh.triangle_count()));
    double b1 = random.uniform(), b2 = random.uniform();
    if (b1 + b2 > 1.0) b1 = 1.0 - b1, b2 = 1.0 - b2;
    if (k % 3 == 0) b2 = 0.0;
    const auto uv = [&](int axis) {
      return (1.0 - b1 - b2) * mesh.uvs(mesh.triangles(t, 0), axis) +
             b1 * mesh.uvs(mesh.triangles(t, 1), axis) + b2 * mesh.uvs(mesh.triangles(t, 2), axis);
    };
    const int c = static_cast<int>(std::floor(uv(0) * width - 0.5));
    const int r = static_cast<int>(std::floor((1.0 - uv(1)) * height - 0.5));
    for (int i = 0; i < 4; ++i) {
      ASSERT_TRUE(owned[static_cast<std::size_t>(r + i / 2) * width + c + i % 2])
          << "near (" << uv(0) << ", " << uv(1) << ")";
    }
  }
}

}  // namespace
}  // namespace semblance
