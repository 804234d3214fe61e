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

TEST(Sheet, DiscIsNearlyEquilateral) {
  const Sheet disc = make_disc(0.15, 0.01);
  double shortest = 1.0, longest = 0.0;
  for (int t = 0; t < disc.triangles.rows(); ++t) {
    for (int k = 0; k < 3; ++k) {
      const double side = (disc.material_m.row(disc.triangles(t, k)) -
                           disc.material_m.row(disc.triangles(t, (k + 1) % 3)))
                              .norm();
      shortest = std::min(shortest, side);
      longest = std::max(longest, side);
    }
  }
  EXPECT_GT(shortest, 0.008);
  EXPECT_LT(longest, 0.0145);
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

}  // namespace
}  // namespace semblance
