#include "semblance/geometry/cylindrical_scan.h"

#include <embree3/rtcore.h>
#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <cmath>
#include <memory>
#include <random>

#include "scan_meshes.h"
#include "semblance/core/errors.h"

namespace semblance {
namespace {

using Eigen::Index;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

Mesh make_box(const Eigen::Vector3d& half) {
  Mesh mesh;
  mesh.positions_m.resize(8, 3);
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3d corner(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
    mesh.positions_m.row(i) = corner.cwiseProduct(half);
  }
  mesh.triangles.resize(12, 3);
  mesh.triangles << 0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4, 2, 6, 3, 3, 6, 7, 0, 4, 2,
      2, 4, 6, 1, 3, 5, 3, 7, 5;
  return mesh;
}

/// A rough surface that folds over itself along the rays, moved and turned.
Mesh make_crumpled(unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> noise(-0.25, 0.25);
  return testing::make_globe(40, 25, [&](double longitude, double latitude) {
    const double radius = 1.0 + noise(random);
    return Eigen::Vector3d(radius * std::cos(latitude) * std::sin(longitude) + noise(random),
                           1.3 * std::sin(latitude) + 0.3 * noise(random),
                           radius * std::cos(latitude) * std::cos(longitude) + noise(random));
  });
}

/// The ray of a sample, from outside to the axis.
struct InwardRay {
  Eigen::Vector3d origin, direction;
};
InwardRay inward_ray(const RangeMap& map, Index row, Index column, double far_m) {
  const double a = map.column_angle_rad(column);
  const Eigen::Vector3d out(std::sin(a), 0, std::cos(a));
  return {map.world_from_map * (Eigen::Vector3d(0, map.height_m(row), 0) + far_m * out),
          map.world_from_map.rotation * -out};
}

/// Moeller and Trumbore 1997; infinity where the triangle is missed.
double distance_to(const InwardRay& ray, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                   const Eigen::Vector3d& c) {
  const Eigen::Vector3d e1 = b - a, e2 = c - a, p = ray.direction.cross(e2), s = ray.origin - a;
  const double determinant = e1.dot(p);
  const double u = s.dot(p) / determinant, v = ray.direction.dot(s.cross(e1)) / determinant;
  const bool hit = determinant != 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0;
  return hit ? e2.dot(s.cross(e1)) / determinant : std::numeric_limits<double>::infinity();
}

TEST(CylindricalScan, BoxIsItsClosedForm) {
  ScanOptions options;
  options.columns = 90;
  options.rows = 14;
  const RangeMap map = scan_cylinder(make_box({0.3, 0.7, 0.4}), options);
  EXPECT_NEAR(map.spacing_m, 0.1, 1e-15);
  EXPECT_NEAR(map.point(0, 0).y(), -0.65, 1e-12);
  for (Index row = 0; row < map.rows(); ++row) {
    for (Index column = 0; column < map.columns(); ++column) {
      const double a = map.column_angle_rad(column);
      const double expected = std::min(0.3 / std::abs(std::sin(a)), 0.4 / std::abs(std::cos(a)));
      EXPECT_NEAR(map.radius_m(row, column), expected, 1e-7);
    }
  }
}

TEST(CylindricalScan, ConeAndSphereApproachTheirClosedForms) {
  ScanOptions options;
  options.columns = 64;
  options.rows = 40;
  const Mesh cone = testing::make_globe(2000, 1, [](double longitude, double latitude) {
    const double radius = latitude > 0 ? 0.2 : 1.0;
    return Eigen::Vector3d(radius * std::sin(longitude), latitude > 0 ? 1.0 : 0.0,
                           radius * std::cos(longitude));
  });
  const Mesh sphere = testing::make_globe(1000, 500, [](double longitude, double latitude) {
    return Eigen::Vector3d(std::cos(latitude) * std::sin(longitude), std::sin(latitude),
                           std::cos(latitude) * std::cos(longitude));
  });
  const RangeMap cone_map = scan_cylinder(cone, options), ball = scan_cylinder(sphere, options);
  for (Index row = 0; row < cone_map.rows(); ++row) {
    // Chords of a circle in 2000 and 1000 parts lie 1 - cos(pi / parts) inside it at most.
    const double height = cone_map.height_m(row), y = ball.height_m(row) - 1.0;
    EXPECT_NEAR(cone_map.radius_m.row(row).minCoeff(), 1.0 - 0.8 * height, 1.5e-6);
    EXPECT_NEAR(cone_map.radius_m.row(row).maxCoeff(), 1.0 - 0.8 * height, 1.5e-6);
    const double circle = std::sqrt(1.0 - y * y);
    EXPECT_NEAR(ball.radius_m.row(row).mean(), circle, 3e-5 / circle);
  }
}

TEST(CylindricalScan, FindsTheOutermostHitLikeBruteForce) {
  const Mesh mesh = make_crumpled(3);
  ScanOptions options;
  options.columns = 48;
  options.rows = 31;
  options.up = {0.2, 1.0, -0.1};
  options.front = {1.0, 0.3, 0.5};
  options.axis_point_m = Eigen::Vector3d(0.1, 0.0, -0.05);
  const RangeMap map = scan_cylinder(mesh, options);
  constexpr double far_m = 10.0;
  for (Index row = 0; row < map.rows(); ++row) {
    for (Index column = 0; column < map.columns(); ++column) {
      const InwardRay ray = inward_ray(map, row, column, far_m);
      double nearest = far_m;
      for (Index t = 0; t < mesh.triangle_count(); ++t) {
        nearest = std::min(nearest, distance_to(ray, mesh.positions_m.row(mesh.triangles(t, 0)),
                                                mesh.positions_m.row(mesh.triangles(t, 1)),
                                                mesh.positions_m.row(mesh.triangles(t, 2))));
      }
      EXPECT_NEAR(map.radius_m(row, column), far_m - nearest, 1e-6) << row << ", " << column;
      EXPECT_EQ(map.samples(row, column) == RangeSample::measured, nearest < far_m);
    }
  }
}

/// Embree's rays against a mesh.
class EmbreeScene {
 public:
  explicit EmbreeScene(const Mesh& mesh) {
    const RTCGeometry geometry = rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<float*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                3 * sizeof(float), static_cast<std::size_t>(mesh.vertex_count())));
    auto* indices = static_cast<unsigned*>(rtcSetNewGeometryBuffer(
        geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(unsigned),
        static_cast<std::size_t>(mesh.triangle_count())));
    std::copy_n(mesh.positions_m.data(), mesh.positions_m.size(), vertices);
    std::copy_n(mesh.triangles.data(), mesh.triangles.size(), indices);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_.get(), geometry);
    rtcReleaseGeometry(geometry);
    rtcSetSceneFlags(scene_.get(), RTC_SCENE_FLAG_ROBUST);
    rtcCommitScene(scene_.get());
  }
  /// Distance to the first hit, or `far_m`.
  double first_hit(const InwardRay& ray, double far_m) const {
    RTCRayHit query{};
    query.ray.org_x = static_cast<float>(ray.origin.x());
    query.ray.org_y = static_cast<float>(ray.origin.y());
    query.ray.org_z = static_cast<float>(ray.origin.z());
    query.ray.dir_x = static_cast<float>(ray.direction.x());
    query.ray.dir_y = static_cast<float>(ray.direction.y());
    query.ray.dir_z = static_cast<float>(ray.direction.z());
    query.ray.tfar = static_cast<float>(far_m);
    query.ray.mask = ~0u;
    query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect1(scene_.get(), &context, &query);
    return query.ray.tfar;
  }

 private:
  std::unique_ptr<RTCDeviceTy, decltype(&rtcReleaseDevice)> device_{rtcNewDevice(nullptr),
                                                                    rtcReleaseDevice};
  std::unique_ptr<RTCSceneTy, decltype(&rtcReleaseScene)> scene_{rtcNewScene(device_.get()),
                                                                 rtcReleaseScene};
};

TEST(CylindricalScan, AgreesWithEmbree) {
  const Mesh mesh = make_crumpled(11);
  ScanOptions options;
  options.columns = 200;
  options.rows = 150;
  const RangeMap map = scan_cylinder(mesh, options);
  const EmbreeScene scene(mesh);
  constexpr double far_m = 4.0;
  int grazing = 0;
  for (Index row = 0; row < map.rows(); ++row) {
    for (Index column = 0; column < map.columns(); ++column) {
      const double embree_m = far_m - scene.first_hit(inward_ray(map, row, column, far_m), far_m);
      // Rays that graze an edge fall to either side in single precision.
      if (std::abs(map.radius_m(row, column) - embree_m) > 1e-4) ++grazing;
    }
  }
  EXPECT_LE(grazing, map.radius_m.size() / 5000);
}

TEST(CylindricalScan, ScansAgainInTheSameFrame) {
  const Mesh mesh = make_crumpled(5);
  ScanOptions options;
  options.columns = 40;
  options.rows = 30;
  options.up = {0.1, 1.0, 0.2};
  const RangeMap map = scan_cylinder(mesh, options), again = scan_like(mesh, map);
  EXPECT_LT((map.radius_m - again.radius_m).abs().maxCoeff(), 1e-5f);
}

TEST(CylindricalScan, LeavesVoidWhatNoRayMeets) {
  Mesh wall;  // a quarter of a box: nothing behind the axis
  wall.positions_m.resize(4, 3);
  wall.positions_m << -1, 0, 0.5, 1, 0, 0.5, 1, 1, 0.5, -1, 1, -0.2;
  wall.triangles.resize(2, 3);
  wall.triangles << 0, 1, 2, 0, 2, 3;
  ScanOptions options;
  options.columns = 36;
  options.rows = 10;
  options.axis_point_m = Eigen::Vector3d(0, 0, 0.1);
  const RangeMap map = scan_cylinder(wall, options);
  EXPECT_EQ(map.samples(0, 0), RangeSample::none);  // behind
  EXPECT_EQ(map.radius_m(0, 0), 0.0f);
  EXPECT_EQ(map.samples(0, 18), RangeSample::measured);
}

TEST(CylindricalScan, RejectsWhatCannotBeScanned) {
  Mesh mesh = make_box({1, 1, 1});
  ScanOptions options;
  options.axis_point_m = Eigen::Vector3d(3, 0, 0);
  EXPECT_THAT([&] { scan_cylinder(mesh, options); },
              ThrowsMessage<InvalidInput>(HasSubstr("axis passes beside")));
  options = {};
  options.front = {0, 2, 0};
  EXPECT_THAT([&] { scan_cylinder(mesh, options); },
              ThrowsMessage<InvalidInput>(HasSubstr("up and front")));
  options = {};
  options.rows = 1;
  EXPECT_THROW(scan_cylinder(mesh, options), InvalidInput);
  mesh.triangles.resize(0, 3);
  EXPECT_THAT([&] { scan_cylinder(mesh); }, ThrowsMessage<InvalidInput>(HasSubstr("no triangles")));
}

}  // namespace
}  // namespace semblance
