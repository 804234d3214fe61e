#include "semblance/core/mesh.h"

#include <gmock/gmock.h>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <cmath>
#include <limits>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

// Unit sphere by latitude and longitude, closed at the poles, counter-clockwise from outside.
Mesh sphere(int rings, int sectors) {
  Mesh mesh;
  mesh.positions_m.resize(2 + (rings - 1) * sectors, 3);
  mesh.positions_m.row(0) << 0.0, 1.0, 0.0;
  mesh.positions_m.row(1) << 0.0, -1.0, 0.0;
  const auto index = [sectors](int ring, int sector) {
    return 2 + (ring - 1) * sectors + sector % sectors;
  };
  for (int ring = 1; ring < rings; ++ring) {
    for (int sector = 0; sector < sectors; ++sector) {
      const double down = M_PI * ring / rings, around = 2.0 * M_PI * sector / sectors;
      mesh.positions_m.row(index(ring, sector)) << std::sin(down) * std::sin(around),
          std::cos(down), std::sin(down) * std::cos(around);
    }
  }
  std::vector<Eigen::RowVector3i> triangles;
  for (int sector = 0; sector < sectors; ++sector) {
    triangles.emplace_back(0, index(1, sector), index(1, sector + 1));
    triangles.emplace_back(1, index(rings - 1, sector + 1), index(rings - 1, sector));
    for (int ring = 1; ring + 1 < rings; ++ring) {
      const int a = index(ring, sector), b = index(ring + 1, sector);
      const int c = index(ring + 1, sector + 1), d = index(ring, sector + 1);
      triangles.emplace_back(a, b, c);
      triangles.emplace_back(a, c, d);
    }
  }
  mesh.triangles.resize(static_cast<Eigen::Index>(triangles.size()), 3);
  for (std::size_t i = 0; i < triangles.size(); ++i) mesh.triangles.row(i) = triangles[i];
  return mesh;
}

TEST(VertexNormals, PointOutwardsOnASphere) {
  const Mesh mesh = sphere(40, 80);
  PointsF normals;
  vertex_normals(mesh.positions_m.cast<float>(), mesh.triangles, normals);
  ASSERT_EQ(normals.rows(), mesh.vertex_count());
  for (Eigen::Index i = 0; i < normals.rows(); ++i) {
    EXPECT_NEAR(normals.row(i).norm(), 1.0f, 1e-6f);
    EXPECT_GT(normals.row(i).cast<double>().dot(mesh.positions_m.row(i)), std::cos(0.02));
  }
}

TEST(VertexNormals, AreWeightedByArea) {
  // Two right triangles share vertex 0: areas 2 (normal z) and 1/2 (normal x).
  PointsF positions(5, 3);
  positions << 0, 0, 0, 2, 0, 0, 0, 2, 0, 0, 1, 0, 0, 0, 1;
  Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor> triangles(2, 3);
  triangles << 0, 1, 2, 0, 3, 4;
  PointsF normals;
  vertex_normals(positions, triangles, normals);
  const Eigen::RowVector3f expected = Eigen::RowVector3f(0.5f, 0.0f, 2.0f).normalized();
  EXPECT_TRUE(normals.row(0).isApprox(expected, 1e-6f));
}

TEST(VertexNormals, OfSmallFacesAreUnitAndOfNoneAreZero) {
  PointsF positions(4, 3);
  positions << 0, 0, 0, 1e-5f, 0, 0, 0, 1e-5f, 0, 5, 5, 5;
  Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor> triangles(1, 3);
  triangles << 0, 1, 2;
  PointsF normals = PointsF::Constant(9, 3, 4.0f);
  vertex_normals(positions, triangles, normals);
  ASSERT_EQ(normals.rows(), 4);
  EXPECT_TRUE(normals.row(1).isApprox(Eigen::RowVector3f(0, 0, 1)));
  EXPECT_EQ(normals.row(3), Eigen::RowVector3f(0, 0, 0));
}

std::string complaint(const Mesh& mesh) {
  try {
    validate(mesh, "head.obj");
  } catch (const InvalidInput& error) {
    return error.what();
  }
  return "";
}

TEST(Mesh, ValidateNamesSourceAndPlace) {
  const Mesh good = sphere(4, 6);
  EXPECT_EQ(complaint(good), "");
  EXPECT_EQ(complaint(Mesh()), "");
  Mesh bad = good;
  bad.positions_m(5, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(complaint(bad), AllOf(HasSubstr("head.obj"), HasSubstr("vertex 5")));
  bad = good;
  bad.triangles(3, 2) = 1000;
  EXPECT_THAT(complaint(bad), AllOf(HasSubstr("triangle 3"), HasSubstr("vertex 1000")));
  bad = good;
  bad.triangles(2, 0) = -1;
  EXPECT_THAT(complaint(bad), AllOf(HasSubstr("triangle 2"), HasSubstr("vertex -1")));
  bad = good;
  bad.triangles.row(4) << 3, 7, 3;
  EXPECT_THAT(complaint(bad), AllOf(HasSubstr("triangle 4"), HasSubstr("twice")));
  bad = good;
  bad.uvs.setZero(3, 2);
  EXPECT_THAT(complaint(bad), HasSubstr("3 texture coordinates"));
  bad.uvs.setConstant(good.vertex_count(), 2, std::numeric_limits<float>::infinity());
  EXPECT_THAT(complaint(bad), HasSubstr("not finite"));
}

}  // namespace
}  // namespace semblance
