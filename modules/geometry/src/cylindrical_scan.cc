#include "semblance/geometry/cylindrical_scan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

using Eigen::Index;
using Points = decltype(Mesh::positions_m);

constexpr double pi = std::numbers::pi;

void check(const Mesh& mesh, const ScanOptions& options) {
  const int most = static_cast<int>(most_range_samples_per_side);
  if (options.rows < fewest_range_rows || options.columns < fewest_range_columns ||
      options.rows > most || options.columns > most) {
    throw InvalidInput("scan: " + std::to_string(options.columns) + " columns and " +
                       std::to_string(options.rows) +
                       " rows were asked for; from 3 x 2 to 8192 x 8192 are possible");
  }
  if (mesh.triangle_count() == 0) {
    throw InvalidInput("scan: the mesh has no triangles; a surface is needed, not points alone");
  }
  if (!(options.up.cross(options.front).norm() > 1e-9 * options.up.norm() * options.front.norm())) {
    throw InvalidInput("scan: the directions up and front must be different lines");
  }
}

/// The rotation into a frame with y along `up` and `front` in the half-plane x = 0, z > 0.
Eigen::Quaterniond map_from_world(const ScanOptions& options) {
  const Eigen::Vector3d y = options.up.normalized(), x = y.cross(options.front).normalized();
  Eigen::Matrix3d rotation;
  rotation << x.transpose(), y.transpose(), x.cross(y).transpose();
  return Eigen::Quaterniond(rotation).normalized();
}

/// Where an edge meets the plane at `height`, as (x, z). Its ends are ordered first, so that both
/// triangles of an edge find the same point.
Eigen::Vector2d crossing(Eigen::Vector3d a, Eigen::Vector3d b, double height) {
  if (a.y() > b.y()) std::swap(a, b);
  const double t = (height - a.y()) / (b.y() - a.y());
  const Eigen::Vector3d point = a + t * (b - a);
  return {point.x(), point.z()};
}

/// Collects the outermost radii of one row.
class RowScan {
 public:
  explicit RowScan(const std::vector<Eigen::Vector2d>& directions) : directions_(directions) {}

  /// A piece of the surface's section: every ray that meets it.
  void add(const Eigen::Vector2d& p, const Eigen::Vector2d& q, Grid::RowXpr radii) const {
    const double start = std::atan2(p.x(), p.y());
    double turn = std::atan2(q.x(), q.y()) - start;
    if (turn > pi) turn -= 2.0 * pi;
    if (turn < -pi) turn += 2.0 * pi;
    const auto columns = static_cast<double>(directions_.size());
    const auto column = [&](double angle) { return (angle + pi) * columns / (2.0 * pi) - 0.5; };
    // A ray through a corner belongs to both pieces that meet there.
    constexpr double corner = 1e-9;
    const auto first =
        static_cast<Index>(std::ceil(column(std::min(start, start + turn)) - corner));
    const auto last =
        static_cast<Index>(std::floor(column(std::max(start, start + turn)) + corner));
    const auto count = static_cast<Index>(directions_.size());
    for (Index k = first; k <= last; ++k) {
      const Index j = (k + 2 * count) % count;
      radii[j] = std::max(radii[j], static_cast<float>(radius(p, q, directions_[j])));
    }
  }

 private:
  static double radius(const Eigen::Vector2d& p, const Eigen::Vector2d& q,
                       const Eigen::Vector2d& direction) {
    const auto beside = [&](const Eigen::Vector2d& a) {
      return direction.x() * a.y() - direction.y() * a.x();
    };
    const double at_p = beside(p), at_q = beside(q);
    if (at_p == at_q) return std::max(direction.dot(p), direction.dot(q));
    const double t = std::clamp(at_p / (at_p - at_q), 0.0, 1.0);
    return direction.dot(p + t * (q - p));
  }

  const std::vector<Eigen::Vector2d>& directions_;
};

void scan_triangle(const std::array<Eigen::Vector3d, 3>& corner, const RowScan& row_scan,
                   RangeMap& map) {
  const auto [low, high] = std::minmax({corner[0].y(), corner[1].y(), corner[2].y()});
  const auto row_of = [&](double height) { return (height - map.bottom_m) / map.spacing_m; };
  const auto first = std::max<Index>(0, static_cast<Index>(std::floor(row_of(low))));
  const auto last = std::min<Index>(map.rows() - 1, static_cast<Index>(std::ceil(row_of(high))));
  for (Index row = first; row <= last; ++row) {
    const double height = map.height_m(row);
    std::array<Eigen::Vector2d, 2> ends;
    int found = 0;
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d &a = corner[k], &b = corner[(k + 1) % 3];
      // A corner in the plane counts as above it, so a section has two ends or none.
      if ((a.y() < height) != (b.y() < height)) ends[found++] = crossing(a, b, height);
    }
    if (found == 2) row_scan.add(ends[0], ends[1], map.radius_m.row(row));
  }
}

/// Fills a map without radii; `points` are the mesh's in its frame.
void scan_triangles(const Points& points, const Mesh& mesh, RangeMap& map) {
  std::vector<Eigen::Vector2d> directions;
  for (Index j = 0; j < map.columns(); ++j) {
    const double angle = map.column_angle_rad(j);
    directions.emplace_back(std::sin(angle), std::cos(angle));
  }
  const RowScan row_scan(directions);
  for (Index t = 0; t < mesh.triangle_count(); ++t) {
    scan_triangle({points.row(mesh.triangles(t, 0)), points.row(mesh.triangles(t, 1)),
                   points.row(mesh.triangles(t, 2))},
                  row_scan, map);
  }
  map.samples = RangeMap::Samples::Constant(map.rows(), map.columns(), RangeSample::none);
  map.samples = (map.radius_m > 0.0f).select(RangeSample::measured, map.samples);
  if ((map.samples == RangeSample::none).all()) {
    throw InvalidInput("scan: no ray from the axis meets the mesh; move the axis into it");
  }
}

/// The map's frame and rows around the mesh; `points` are rotated into the frame and moved to it.
RangeMap empty_map(Points& points, const ScanOptions& options) {
  const Eigen::Quaterniond rotation = map_from_world(options);
  points = (points * rotation.toRotationMatrix().transpose()).eval();
  const Eigen::Vector3d low = points.colwise().minCoeff(), high = points.colwise().maxCoeff();
  Eigen::Vector3d origin = 0.5 * (low + high);
  if (options.axis_point_m) origin = rotation * *options.axis_point_m;
  const bool inside = origin.x() > low.x() && origin.x() < high.x() && origin.z() > low.z() &&
                      origin.z() < high.z();
  if (!inside) {
    throw InvalidInput(
        "scan: the axis passes beside the mesh; choose a point of it within the mesh's extent");
  }
  origin.y() = low.y();
  points.rowwise() -= origin.transpose();
  RangeMap map;
  map.spacing_m = (high.y() - low.y()) / options.rows;
  if (!(map.spacing_m > 0.0)) {
    throw InvalidInput("scan: the mesh has no extent along the axis; turn the axis");
  }
  map.bottom_m = 0.5 * map.spacing_m;
  map.radius_m = Grid::Zero(options.rows, options.columns);
  map.world_from_map = Rigid3{rotation.conjugate(), rotation.conjugate() * origin};
  return map;
}

}  // namespace

RangeMap scan_cylinder(const Mesh& mesh, const ScanOptions& options) {
  check(mesh, options);
  validate(mesh, "scan");
  Points points = mesh.positions_m;
  RangeMap map = empty_map(points, options);
  scan_triangles(points, mesh, map);
  return map;
}

RangeMap scan_like(const Mesh& mesh, const RangeMap& other) {
  validate(other, "scan");
  validate(mesh, "scan");
  const Rigid3 map_from_world = other.world_from_map.inverse();
  Points points = mesh.positions_m * map_from_world.rotation.toRotationMatrix().transpose();
  points.rowwise() += map_from_world.translation_m.transpose();
  RangeMap map = other;
  map.radius_m.setZero();
  scan_triangles(points, mesh, map);
  return map;
}

}  // namespace semblance
