#include <gmock/gmock.h>

#include "semblance/cloth/contact.h"
#include "sheets.h"

namespace semblance {
namespace {

using testing::crumpled;
using testing::make_sheet;
using testing::rolled;
using Kind = Penetration::Kind;

std::vector<Obstacle> some_obstacles() {
  const Rigid3 tilted{quaternion_from_rotation_vector({0.3, 0.5, -0.2}), {0.02, 0.01, 0.0}};
  return {make_box("box", {0.06, 0.05, 0.07}, tilted), make_prism("prism", 0.05, 0.03, 20),
          make_sphere("sphere", 0.03), make_plane("floor", {0, -0.05, 0}, {0, 1, 0}),
          make_mesh_obstacle("mesh", obstacle_mesh(make_capsule("", 0.03, 0.05, tilted), 0.0))};
}

TEST(Penetrations, AreTheSameByTreeAndByBruteForce) {
  const ContactSurface sheet = make_sheet(21, 17, 0.01);
  ContactFinder finder(sheet, some_obstacles(), {});
  for (int seed = 0; seed < 4; ++seed) {
    const Points x = crumpled(sheet.rest_positions_m, 0.05, 0.04, seed);
    const auto by_tree = finder.penetrations(x), by_force = finder.penetrations(x, true);
    EXPECT_EQ(by_tree, by_force);
    std::array<int, 4> counts{};
    for (const Penetration& p : by_tree) ++counts[static_cast<int>(p.kind)];
    for (const int count : counts) EXPECT_GT(count, 0);
  }
}

TEST(Penetrations, AreTheSameWhereEverythingIsDegenerate) {
  // Few distinct coordinates: parts coincide, touch, and lie in common planes.
  const ContactSurface sheet = make_sheet(9, 8, 0.01);
  const std::vector<Obstacle> box = {make_box("box", {2.0, 2.0, 2.0})};
  ContactFinder finder(sheet, box, {});
  for (int seed = 0; seed < 6; ++seed) {
    Random random(seed);
    Points x(sheet.rest_positions_m.rows(), 3);
    for (Eigen::Index v = 0; v < x.rows(); ++v)
      for (int k = 0; k < 3; ++k) x(v, k) = random.integer(seed < 3 ? 3 : 9) - 1;
    EXPECT_EQ(finder.penetrations(x), finder.penetrations(x, true));
  }
}

TEST(Penetrations, AreNoneInASheetThatOnlyTouchesNearly) {
  const ContactSurface sheet = make_sheet(81, 11, 0.005);
  ContactFinder finder(sheet, {}, {});
  const Points x = rolled(sheet.rest_positions_m, 1e-3, 0.01);
  EXPECT_TRUE(finder.penetrations(x).empty());
  EXPECT_TRUE(finder.penetrations(sheet.rest_positions_m).empty());
}

TEST(Penetrations, SeeAnEdgeThatCutsASharpEdgeBetweenVertices) {
  // No vertex is inside: node-only tests miss it.
  const ContactSurface sheet = make_sheet(5, 5, 0.1);
  const Rigid3 on_edge{quaternion_from_rotation_vector({0.0, 0.0, 0.25 * M_PI}),
                       {0.05, -0.0607, 0.0}};
  ContactFinder finder(sheet, {make_box("bar", {0.1, 0.1, 2.0}, on_edge)}, {});
  const auto found = finder.penetrations(sheet.rest_positions_m);
  EXPECT_FALSE(found.empty());
  for (const Penetration& p : found) EXPECT_NE(p.kind, Kind::vertex_inside);
}

TEST(Start, ClothIsPushedOutOfSolidsAndStaysWhereItIsClear) {
  const ContactSurface sheet = make_sheet(11, 11, 0.01);
  const Rigid3 below{Eigen::Quaterniond::Identity(), {0.0, -0.1, 0.0}};
  ContactFinder finder(sheet, {make_box("table", {0.1, 0.2, 0.3}, below)}, {});
  // Folded over the table's edge, but a chord cuts it: no vertex is inside.
  Points x = sheet.rest_positions_m;
  const double middle = 0.5 * (x.col(0).minCoeff() + x.col(0).maxCoeff());
  for (Eigen::Index v = 0; v < x.rows(); ++v) {
    const double along = x(v, 0) - middle - 0.005;  // triangles bridge the edge
    x(v, 0) = along < 0.0 ? 0.05 + along : 0.0515;
    x(v, 1) = along < 0.0 ? 0.0015 : 0.0015 - along;
  }
  const auto found = finder.penetrations(x);
  ASSERT_FALSE(found.empty());
  for (const Penetration& p : found) ASSERT_EQ(p.obstacle, 0);
  const Points before = x;
  const double moved_m = finder.push_out(x, 0.0025);
  EXPECT_EQ(finder.start_problem(x), std::nullopt);
  EXPECT_TRUE(finder.penetrations(x, true).empty());
  EXPECT_GT(moved_m, 0.0);
  EXPECT_LE(moved_m, 0.01);
  for (Eigen::Index v = 0; v < x.rows(); ++v) {
    const bool is_clear = before(v, 0) < 0.03 || before(v, 1) < -0.02;
    if (is_clear) {
      EXPECT_EQ(x.row(v), before.row(v)) << v;
    }
  }
}

TEST(Start, SaysWhatIsInTheWay) {
  const ContactSurface sheet = make_sheet(11, 11, 0.01);
  ContactOptions options;
  options.thickness_m = 1e-3;
  const Rigid3 below{Eigen::Quaterniond::Identity(), {0.0, -0.1, 0.0}};
  ContactFinder finder(sheet, {make_box("table", {0.3, 0.2, 0.3}, below)}, options);
  Points x = sheet.rest_positions_m;
  x.col(1).array() += 0.01;
  EXPECT_EQ(finder.start_problem(x), std::nullopt);
  x(60, 1) = -0.002;
  EXPECT_THAT(finder.start_problem(x).value_or(""),
              ::testing::AllOf(::testing::HasSubstr("vertex 61"), ::testing::HasSubstr("\"table\""),
                               ::testing::HasSubstr("2.0")));
  x(60, 1) = 0.0003;
  EXPECT_THAT(finder.start_problem(x).value_or(""),
              ::testing::AllOf(::testing::HasSubstr("vertex 61"), ::testing::HasSubstr("0.2")));
  x = sheet.rest_positions_m;
  x.col(1).array() += 0.1;
  x.row(0) << x(60, 0) + 0.002, x(60, 1) - 0.05, x(60, 2) + 0.001;
  x.row(1) << x(60, 0) + 0.002, x(60, 1) + 0.05, x(60, 2) + 0.001;
  EXPECT_THAT(finder.start_problem(x).value_or(""), ::testing::HasSubstr("crosses itself"));
}

}  // namespace
}  // namespace semblance
