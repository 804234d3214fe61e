#include "semblance/cloth/obstacle.h"

#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <limits>

#include "semblance/cloth/distance.h"
#include "semblance/core/errors.h"
#include "semblance/core/random.h"

namespace semblance {
namespace {

using Eigen::Vector3d;

double distance_to(const Points& x, const Triangles& triangles, const Vector3d& p) {
  double least = std::numeric_limits<double>::infinity();
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    const TrianglePoint closest = closest_on_triangle(
        p, x.row(triangles(t, 0)), x.row(triangles(t, 1)), x.row(triangles(t, 2)));
    least = std::min(least, closest.offset_m.norm());
  }
  return least;
}

/// Volume by the divergence theorem: positive only if triangles face outwards.
double volume(const Points& x, const Triangles& triangles) {
  double sum = 0.0;
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    const Vector3d a = x.row(triangles(t, 0)), b = x.row(triangles(t, 1)),
                   c = x.row(triangles(t, 2));
    sum += a.dot(b.cross(c)) / 6.0;
  }
  return sum;
}

std::vector<Obstacle> some_solids() {
  return {make_box("box", {0.6, 0.2, 0.5}),  make_box("rounded box", {0.6, 0.2, 0.5}, {}, 0.03),
          make_prism("prism", 0.3, 0.1, 7),  make_prism("rounded prism", 0.3, 0.1, 12, {}, 0.02),
          make_capsule("capsule", 0.1, 0.4), make_sphere("sphere", 0.25)};
}

TEST(Solids, DistanceIsThatToTheirFaces) {
  Random random(3);
  for (const Obstacle& obstacle : some_solids()) {
    const Solid& solid = *obstacle.solid;
    if (solid.faces.rows() == 0) continue;
    for (int i = 0; i < 2000; ++i) {
      const Vector3d p(random.uniform(-0.6, 0.6), random.uniform(-0.4, 0.4),
                       random.uniform(-0.6, 0.6));
      const SurfacePoint closest = solid.closest(p);
      const double to_core = closest.distance_m + solid.rounding_m;
      EXPECT_NEAR(std::abs(to_core), distance_to(solid.corners_m, solid.faces, p), 1e-12)
          << obstacle.name;
      EXPECT_NEAR(closest.normal.norm(), 1.0, 1e-12);
      EXPECT_LT((closest.point_m + closest.distance_m * closest.normal - p).norm(), 1e-12);
    }
  }
}

TEST(Solids, AreInsideWhereTheirFacesSaySo) {
  for (const Obstacle& obstacle : some_solids()) {
    const Solid& solid = *obstacle.solid;
    EXPECT_LT(solid.closest({0.01, 0.02, -0.01}).distance_m, 0.0) << obstacle.name;
    EXPECT_GT(solid.closest({0.0, 0.5, 0.0}).distance_m, 0.0) << obstacle.name;
    if (solid.faces.rows() > 0) {
      EXPECT_GT(volume(solid.corners_m, solid.faces), 0.0);
    }
  }
  EXPECT_NEAR(volume(some_solids()[0].solid->corners_m, some_solids()[0].solid->faces), 0.06,
              1e-15);
}

TEST(Solids, AreDrawnWhereTheyAre) {
  for (const Obstacle& obstacle : some_solids()) {
    const Mesh mesh = obstacle_mesh(obstacle, 0.0);
    EXPECT_NO_THROW(validate(mesh, obstacle.name));
    EXPECT_GT(volume(mesh.positions_m, mesh.triangles), 0.0) << obstacle.name;
    for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v)
      EXPECT_NEAR(obstacle.solid->closest(mesh.positions_m.row(v)).distance_m, 0.0, 1e-12)
          << obstacle.name;
  }
}

TEST(Solids, ListTheirSharpEdges) {
  EXPECT_EQ(make_box("box", {1, 1, 1}).solid->edges.size(), 12u);
  EXPECT_EQ(make_prism("prism", 1, 1, 9).solid->edges.size(), 27u);
  EXPECT_EQ(make_capsule("capsule", 0.1, 1).solid->edges.size(), 1u);
  EXPECT_EQ(make_plane("floor", {0, 0, 0}, {0, 1, 0}).solid->edges.size(), 0u);
  // An edge of the box is a side of two faces that are not in one plane.
  const Obstacle box = make_box("box", {0.6, 0.2, 0.5});
  for (const auto& [a, b] : box.solid->edges) {
    const Vector3d along = box.solid->corners_m.row(a) - box.solid->corners_m.row(b);
    EXPECT_EQ((along.array().abs() > 1e-12).count(), 1);
  }
}

TEST(DrapeTester, HasItsTopWhereItIsAsked) {
  const std::vector<Obstacle> tester = make_drape_tester("tester", {0.1, 1.2, 0.3});
  ASSERT_EQ(tester.size(), 2u);
  const Mesh disc = obstacle_mesh(tester[0], 0.0), stem = obstacle_mesh(tester[1], 0.0);
  EXPECT_NEAR(disc.positions_m.col(1).maxCoeff(), 1.2, 1e-15);
  EXPECT_NEAR(disc.positions_m.col(1).minCoeff(), 1.195, 1e-15);
  EXPECT_NEAR(stem.positions_m.col(1).maxCoeff(), 1.195, 1e-15);
  EXPECT_NEAR(
      (disc.positions_m.rowwise() - Eigen::RowVector3d(0.1, 1.2, 0.3)).rowwise().norm().minCoeff(),
      0.09, 1e-12);
}

TEST(Motion, InterpolatesFramesAndRestsAtTheEnds) {
  const Points zero = Points::Zero(2, 3), one = Points::Ones(2, 3);
  const VertexMotion motion = vertex_frames({1.0, 2.0, 4.0}, {zero, one, 3.0 * one});
  Points x(2, 3);
  for (const auto& [time_s, value] : {std::pair{0.0, 0.0}, {1.25, 0.25}, {3.0, 2.0}, {9.0, 3.0}}) {
    motion(time_s, x);
    EXPECT_TRUE(x.isConstant(value)) << time_s;
  }
  EXPECT_THROW(vertex_frames({1.0, 1.0}, {zero, one}), InvalidInput);
  EXPECT_THROW(vertex_frames({1.0, 2.0}, {zero, Points::Zero(3, 3)}), InvalidInput);
  EXPECT_THROW(vertex_frames({1.0}, {}), InvalidInput);
}

TEST(Obstacles, RefuseSizesThatCannotBe) {
  EXPECT_THROW(make_box("box", {1, 0, 1}), InvalidInput);
  EXPECT_THROW(make_box("box", {1, 0.1, 1}, {}, 0.05), InvalidInput);
  EXPECT_THROW(make_prism("prism", 1, 1, 2), InvalidInput);
  EXPECT_THROW(make_plane("floor", {0, 0, 0}, {0, 0, 0}), InvalidInput);
  EXPECT_THROW(make_sphere("sphere", NAN), InvalidInput);
}

}  // namespace
}  // namespace semblance
