#include "semblance/geometry/range_map.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "semblance/core/errors.h"
#include "semblance/geometry/cylindrical_scan.h"

namespace semblance {
namespace {

using Eigen::Index;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

RangeMap make_map(Index rows, Index columns, float radius_m = 0.1f) {
  RangeMap map;
  map.radius_m = Grid::Constant(rows, columns, radius_m);
  map.samples = RangeMap::Samples::Constant(rows, columns, RangeSample::measured);
  map.spacing_m = 0.01;
  return map;
}

TEST(RangeMap, FillsVoidsWithAMembrane) {
  RangeMap map = make_map(24, 30);
  for (Index row = 0; row < map.rows(); ++row) {
    for (Index column = 0; column < map.columns(); ++column) {
      map.radius_m(row, column) = 0.1f + 0.02f * std::sin(0.5f * static_cast<float>(row * column));
    }
  }
  std::mt19937 random(1);
  for (int i = 0; i < 250; ++i) map.samples(random() % 24, random() % 30) = RangeSample::none;
  map.samples.block(5, 27, 8, 3).setConstant(RangeSample::none);  // at the seam
  map.samples.block(5, 0, 8, 2).setConstant(RangeSample::none);
  map.samples.block(22, 10, 2, 6).setConstant(RangeSample::none);  // at the top
  const RangeMap before = map;
  const double width_m = 2.0 * std::numbers::pi * mean_radius_m(before) / 30.0;
  fill_voids(map);
  const double across = 1.0 / (width_m * width_m), along = 1.0 / (map.spacing_m * map.spacing_m);
  for (Index row = 0; row < map.rows(); ++row) {
    for (Index column = 0; column < map.columns(); ++column) {
      const double here = map.radius_m(row, column);
      if (before.samples(row, column) == RangeSample::measured) {
        EXPECT_EQ(map.radius_m(row, column), before.radius_m(row, column));
        EXPECT_EQ(map.samples(row, column), RangeSample::measured);
        continue;
      }
      EXPECT_EQ(map.samples(row, column), RangeSample::filled);
      // Laplace's equation holds, with mirrored rows beyond the ends.
      const double left = map.radius_m(row, (column + 29) % 30),
                   right = map.radius_m(row, (column + 1) % 30);
      const double below = row > 0 ? map.radius_m(row - 1, column) : here,
                   above = row < 23 ? map.radius_m(row + 1, column) : here;
      const double residual =
          across * (left + right - 2 * here) + along * (below + above - 2 * here);
      EXPECT_NEAR(residual / (2 * across + 2 * along), 0.0, 1e-7) << row << ", " << column;
    }
  }
}

TEST(RangeMap, MeshOfAScanIsScannedBack) {
  RangeMap map = make_map(20, 64);
  map.world_from_map = Rigid3{quaternion_from_rotation_vector({0.2, -0.5, 0.1}), {0.3, 0.1, -0.2}};
  for (Index row = 0; row < 20; ++row) {
    for (Index column = 0; column < 64; ++column) {
      map.radius_m(row, column) = 0.1f + 0.01f * std::sin(0.3f * static_cast<float>(row) +
                                                          0.1f * static_cast<float>(column));
    }
  }
  map.samples(7, 9) = RangeSample::none;
  const Mesh mesh = mesh_from_range_map(map);
  validate(mesh, "test");
  EXPECT_EQ(mesh.vertex_count(), 20 * 64 - 1);
  // Every triangle of the closed surface but those with the void corner (two and one twice).
  EXPECT_EQ(mesh.triangle_count(), 2 * 19 * 64 - 6);
  RangeMap like = map;
  like.samples(7, 9) = RangeSample::measured;
  like.radius_m(7, 9) = 0.1f;
  const RangeMap again = scan_like(mesh, like);
  for (Index row = 1; row < 19; ++row) {
    for (Index column = 0; column < 64; ++column) {
      if (row == 7 && column == 9) continue;
      EXPECT_NEAR(again.radius_m(row, column), map.radius_m(row, column), 1e-5);
    }
  }
  EXPECT_EQ(again.samples(7, 9), RangeSample::none);
}

TEST(RangeMap, TrianglesFaceOutwards) {
  const RangeMap map = make_map(5, 12);
  const Mesh mesh = mesh_from_range_map(map);
  for (Index t = 0; t < mesh.triangle_count(); ++t) {
    const Eigen::Vector3d a = mesh.positions_m.row(mesh.triangles(t, 0)),
                          b = mesh.positions_m.row(mesh.triangles(t, 1)),
                          c = mesh.positions_m.row(mesh.triangles(t, 2));
    EXPECT_GT((b - a).cross(c - a).dot(Eigen::Vector3d(a.x(), 0, a.z())), 0.0);
  }
}

TEST(RangeMap, MeanLeavesOutWhatWasNotMeasured) {
  RangeMap map = make_map(4, 4, 0.2f);
  map.radius_m(0, 0) = 100.0f;
  map.samples(0, 0) = RangeSample::filled;
  map.radius_m(1, 1) = 0.35f;
  EXPECT_NEAR(mean_radius_m(map), (14 * 0.2 + 0.35) / 15, 1e-8);
}

TEST(RangeMap, SaysWhatIsWrong) {
  const auto message = [](const RangeMap& map, const char* text) {
    EXPECT_THAT([&] { validate(map, "x.json"); }, ThrowsMessage<InvalidInput>(::testing::AllOf(
                                                      HasSubstr("x.json"), HasSubstr(text))));
  };
  RangeMap map = make_map(4, 4);
  map.samples.setConstant(RangeSample::none);
  message(map, "no sample");
  map = make_map(4, 4);
  map.samples.resize(3, 4);
  message(map, "differ in size");
  map = make_map(4, 4);
  map.radius_m(2, 1) = std::numeric_limits<float>::quiet_NaN();
  message(map, "row 2 and column 1");
  map = make_map(4, 4);
  map.spacing_m = 0.0;
  message(map, "spacing");
  message(make_map(1, 4), "rows and columns");
}

}  // namespace
}  // namespace semblance
