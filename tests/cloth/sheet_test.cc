#include "semblance/cloth/sheet.h"

#include <gmock/gmock.h>

#include <numbers>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(Sheet, AreasSumToTheWhole) {
  const Sheet rectangle = make_rectangle(0.3, 0.2, 0.03);
  EXPECT_NEAR(rectangle.vertex_areas_m2().sum(), 0.06, 1e-12);
  validate(rectangle, "rectangle");
  const Sheet disc = make_disc(0.15, 0.01);
  EXPECT_NEAR(disc.vertex_areas_m2().sum(), std::numbers::pi * 0.15 * 0.15, 1e-4);
  validate(disc, "disc");
}

double side_m(const Sheet& sheet, int t, int k) {
  return (sheet.material_m.row(sheet.triangles(t, k)) -
          sheet.material_m.row(sheet.triangles(t, (k + 1) % 3)))
      .norm();
}

/// On both circles lie whole edges, without gaps: their polygons have the circles' lengths.
TEST(Sheet, DiscHasEdgesAlongItsCirclesAndNoThinTriangles) {
  for (const double spacing_m : {0.03, 0.0117, 0.004}) {
    const Sheet disc = make_disc(0.15, spacing_m, 0.09);
    validate(disc, "disc");
    for (const double radius_m : {0.09, 0.15}) {
      double length_m = 0.0;
      for (int t = 0; t < disc.triangles.rows(); ++t) {
        for (int k = 0; k < 3; ++k) {
          const auto on = [&](int i) {
            return std::abs(disc.material_m.row(disc.triangles(t, i % 3)).norm() - radius_m) <
                   1e-12;
          };
          if (on(k) && on(k + 1)) length_m += side_m(disc, t, k);
        }
      }
      const double sides = radius_m == 0.15 ? 1.0 : 2.0;  // triangles on either side of the edge
      EXPECT_NEAR(length_m / (sides * 2.0 * std::numbers::pi * radius_m), 1.0, 0.02) << spacing_m;
    }
    for (int t = 0; t < disc.triangles.rows(); ++t) {
      const double a = side_m(disc, t, 0), b = side_m(disc, t, 1), c = side_m(disc, t, 2);
      const double longest = std::max({a, b, c}), s = 0.5 * (a + b + c);
      const double height = 2.0 * std::sqrt(s * (s - a) * (s - b) * (s - c)) / longest;
      EXPECT_GT(height, 0.12 * spacing_m);
      EXPECT_LT(longest, 2.1 * spacing_m);
    }
  }
}

TEST(Sheet, RefusesSpacingsThatDoNotFit) {
  EXPECT_THAT([] { make_rectangle(0.3, 0.2, 0.15); },
              ThrowsMessage<InvalidInput>(HasSubstr("two spacings")));
  EXPECT_THAT([] { make_rectangle(0.3, 0.2, -0.01); },
              ThrowsMessage<InvalidInput>(HasSubstr("spacing -0.01")));
}

Mesh square() {
  Mesh mesh;
  mesh.positions_m.resize(4, 3);
  mesh.positions_m << 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0;
  mesh.uvs = mesh.positions_m.leftCols<2>().cast<float>();
  mesh.triangles.resize(2, 3);
  mesh.triangles << 0, 1, 2, 0, 2, 3;
  return mesh;
}

TEST(Sheet, ReadsAMeshAndNamesWhatIsWrongWithIt) {
  EXPECT_EQ(make_sheet(square(), "s.obj").vertex_count(), 4);
  Mesh bare = square();
  bare.uvs.resize(0, 2);
  EXPECT_THAT([&] { make_sheet(bare, "s.obj"); },
              ThrowsMessage<InvalidInput>(HasSubstr("s.obj: the mesh has no texture coordinates")));
  Mesh inverted = square();
  inverted.triangles.row(1) << 0, 3, 2;
  EXPECT_THAT([&] { make_sheet(inverted, "s.obj"); },
              ThrowsMessage<InvalidInput>(HasSubstr("triangle 2 is inverted")));
  Mesh doubled = square();
  doubled.triangles.conservativeResize(3, 3);
  doubled.triangles.row(2) << 0, 1, 3;
  EXPECT_THAT([&] { make_sheet(doubled, "s.obj"); },
              ThrowsMessage<InvalidInput>(HasSubstr("not a manifold")));
}

TEST(Sheet, RefusesCrowdedVertices) {
  const auto fan = [](int triangles) {
    Mesh mesh;
    mesh.positions_m = Points::Zero(triangles + 2, 3);
    mesh.triangles.resize(triangles, 3);
    for (int k = 0; k <= triangles; ++k)
      mesh.positions_m.row(k + 1) << std::cos(0.05 * k), std::sin(0.05 * k), 0.0;
    for (int k = 0; k < triangles; ++k) mesh.triangles.row(k) << 0, k + 1, k + 2;
    mesh.uvs = mesh.positions_m.leftCols<2>().cast<float>();
    return mesh;
  };
  EXPECT_EQ(make_sheet(fan(64), "f.obj").vertex_count(), 66);
  EXPECT_THAT([&] { make_sheet(fan(65), "f.obj"); },
              ThrowsMessage<InvalidInput>(HasSubstr("vertex 1 is a corner of 65 triangles")));
}

}  // namespace
}  // namespace semblance
