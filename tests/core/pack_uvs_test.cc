#include "semblance/core/pack_uvs.h"

#include <gmock/gmock.h>

#include <Eigen/Geometry>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

using ::testing::HasSubstr;

/// Squares of two triangles each, their texture coordinates from `low` to `high`.
Mesh squares(const std::vector<std::pair<Eigen::RowVector2f, Eigen::RowVector2f>>& charts) {
  const auto count = static_cast<Eigen::Index>(charts.size());
  Mesh mesh;
  mesh.positions_m.setRandom(4 * count, 3);
  mesh.uvs.resize(4 * count, 2);
  mesh.triangles.resize(2 * count, 3);
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto& [low, high] = charts[static_cast<std::size_t>(i)];
    const int v = static_cast<int>(4 * i);
    mesh.uvs.row(v) = low;
    mesh.uvs.row(v + 1) << high.x(), low.y();
    mesh.uvs.row(v + 2) = high;
    mesh.uvs.row(v + 3) << low.x(), high.y();
    mesh.triangles.row(2 * i) << v, v + 1, v + 2;
    mesh.triangles.row(2 * i + 1) << v, v + 2, v + 3;
  }
  return mesh;
}

using Box2f = Eigen::AlignedBox<float, 2>;

TEST(PackUvs, GivesEveryPlaceOfTheSurfaceItsOwn) {
  // Two materials in one square, beside a chart that shares it with neither, and two more squares.
  const Mesh before = squares({{{0.1f, 0.1f}, {0.6f, 0.9f}},
                               {{0.2f, 0.2f}, {0.8f, 0.8f}},
                               {{0.7f, 0.1f}, {0.9f, 0.15f}},
                               {{2.0f, 0.0f}, {3.0f, 1.0f}},
                               {{0.5f, -0.9f}, {0.75f, -0.1f}}});
  Mesh mesh = before;
  pack_uvs(mesh, "head.obj");
  std::vector<Box2f> boxes;
  for (Eigen::Index i = 0; i < 5; ++i) {
    Box2f box;
    for (Eigen::Index v = 4 * i; v < 4 * i + 4; ++v) box.extend(mesh.uvs.row(v).transpose());
    EXPECT_GE(box.min().minCoeff(), 0.0f);
    EXPECT_LE(box.max().maxCoeff(), 1.0f);
    // Charts keep their shape.
    const Eigen::RowVector2f was = before.uvs.row(4 * i + 2) - before.uvs.row(4 * i);
    EXPECT_NEAR(box.sizes().x() / was.x(), box.sizes().y() / was.y(), 1e-4f);
    for (const Box2f& other : boxes) {
      const Box2f both = box.intersection(other);
      EXPECT_TRUE(both.isEmpty() || both.volume() < 1e-6f);
    }
    boxes.push_back(box);
  }
}

TEST(PackUvs, LeavesOneSquareAsItIs) {
  const Mesh before = squares({{{0.0f, 0.0f}, {0.5f, 1.0f}}, {{0.5f, 0.0f}, {1.0f, 1.0f}}});
  Mesh mesh = before;
  pack_uvs(mesh, "head.obj");
  EXPECT_EQ(mesh.uvs, before.uvs);
}

TEST(PackUvs, TakesSquaresFarAway) {
  Mesh mesh = squares({{{4096.0f, -4096.0f}, {4097.0f, -4095.0f}}});
  pack_uvs(mesh, "head.obj");
  EXPECT_GE(mesh.uvs.minCoeff(), 0.0f);
  EXPECT_LE(mesh.uvs.maxCoeff(), 1.0f);
  mesh = squares({{{1e30f, 0.0f}, {3e30f, 1.0f}}});
  EXPECT_THROW(pack_uvs(mesh, "head.obj"), InvalidInput);
}

TEST(PackUvs, RefusesAPieceInTwoSquares) {
  Mesh mesh = squares({{{0.5f, 0.0f}, {1.5f, 1.0f}}});
  try {
    pack_uvs(mesh, "head.obj");
    FAIL();
  } catch (const InvalidInput& error) {
    EXPECT_THAT(error.what(), HasSubstr("head.obj"));
  }
}

}  // namespace
}  // namespace semblance
