#include "semblance/cloth/drape.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include "semblance/cloth/rest.h"
#include "semblance/core/errors.h"

namespace semblance {
namespace {

using Eigen::Vector2d;

constexpr int outline_angles = 720;
constexpr int raster_size = 4096;
constexpr double full_turn = 2.0 * std::numbers::pi;

double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

/// Seen from above, about the centre: x to the right, -z up.
std::vector<Vector2d> shadow_points(const Points& positions_m, const Vector2d& centre_m) {
  std::vector<Vector2d> out(positions_m.rows());
  for (Eigen::Index v = 0; v < positions_m.rows(); ++v) {
    out[v] = {positions_m(v, 0) - centre_m.x(), centre_m.y() - positions_m(v, 2)};
  }
  return out;
}

/// The border's vertices in order; empty where there is not exactly one closed border.
std::vector<int> border(const Triangles& triangles) {
  std::map<std::pair<int, int>, bool> edges;
  for (int t = 0; t < triangles.rows(); ++t) {
    for (int k = 0; k < 3; ++k) edges[{triangles(t, k), triangles(t, (k + 1) % 3)}] = true;
  }
  std::map<int, int> next;
  for (const auto& [edge, unused] : edges) {
    if (edges.contains({edge.second, edge.first})) continue;
    if (!next.emplace(edge.first, edge.second).second) return {};
  }
  if (next.empty()) return {};
  std::vector<int> loop{next.begin()->first};
  while (loop.size() <= next.size()) {
    const auto found = next.find(loop.back());
    if (found == next.end()) return {};
    if (found->second == loop.front())
      return loop.size() == next.size() ? loop : std::vector<int>{};
    loop.push_back(found->second);
  }
  return {};
}

/// Largest distance from the centre at which rays meet any edge of the shadow's triangles.
std::vector<double> outline(const std::vector<Vector2d>& points, const Triangles& triangles) {
  std::vector<double> radii(outline_angles, 0.0);
  const auto meet = [&](const Vector2d& a, const Vector2d& b) {
    const double from = std::atan2(a.y(), a.x());
    double turn = std::atan2(cross(a, b), a.dot(b));
    const double begin = (turn < 0.0 ? from + turn : from) / full_turn * outline_angles;
    const double end = begin + std::abs(turn) / full_turn * outline_angles;
    for (int k = static_cast<int>(std::ceil(begin - 1e-9)); k <= end + 1e-9; ++k) {
      const double angle = full_turn * k / outline_angles;
      const Vector2d ray(std::cos(angle), std::sin(angle));
      const double across = cross(ray, b - a);
      const double radius =
          std::abs(across) < 1e-15 ? std::max(a.norm(), b.norm()) : cross(a, b - a) / across;
      double& out = radii[(k % outline_angles + outline_angles) % outline_angles];
      out = std::max(out, radius);
    }
  };
  for (int t = 0; t < triangles.rows(); ++t) {
    for (int k = 0; k < 3; ++k) meet(points[triangles(t, k)], points[triangles(t, (k + 1) % 3)]);
  }
  return radii;
}

/// Area inside the hem where that is the shadow's outline and star-shaped; else negative.
double star_area(const std::vector<Vector2d>& points, const Triangles& triangles,
                 const std::vector<double>& radii) {
  const std::vector<int> hem = border(triangles);
  double area = 0.0, turn = 0.0;
  std::vector<double> hem_radii(outline_angles, 0.0);
  for (std::size_t i = 0; i < hem.size(); ++i) {
    const Vector2d& a = points[hem[i]];
    const Vector2d& b = points[hem[(i + 1) % hem.size()]];
    if (cross(a, b) <= 0.0) return -1.0;
    area += 0.5 * cross(a, b);
    turn += std::atan2(cross(a, b), a.dot(b));
  }
  if (hem.empty() || std::abs(turn - full_turn) > 1e-6) return -1.0;
  Triangles fan(static_cast<Eigen::Index>(hem.size()), 3);
  for (std::size_t i = 0; i < hem.size(); ++i) {
    fan.row(static_cast<Eigen::Index>(i)) << hem[i], hem[(i + 1) % hem.size()], hem[i];
  }
  hem_radii = outline(points, fan);
  for (int k = 0; k < outline_angles; ++k) {
    if (radii[k] > hem_radii[k] * (1.0 + 1e-6)) return -1.0;  // a fold stands out over the hem
  }
  return area;
}

/// Area of the union of the shadow's triangles, counted on a grid of points.
double raster_area(const std::vector<Vector2d>& points, const Triangles& triangles) {
  double reach = 0.0;
  for (const Vector2d& p : points) reach = std::max(reach, p.cwiseAbs().maxCoeff());
  const double cell = 2.0 * reach * (1.0 + 1e-9) / raster_size;
  std::vector<bool> covered(static_cast<std::size_t>(raster_size) * raster_size, false);
  const auto index = [&](double x) { return (x + reach) / cell - 0.5; };
  for (int t = 0; t < triangles.rows(); ++t) {
    std::array<Vector2d, 3> p;
    for (int k = 0; k < 3; ++k) p[k] = points[triangles(t, k)];
    const double low = std::min({p[0].y(), p[1].y(), p[2].y()});
    const double high = std::max({p[0].y(), p[1].y(), p[2].y()});
    for (int j = std::max(0, static_cast<int>(std::ceil(index(low))));
         j <= std::min<double>(raster_size - 1, index(high)); ++j) {
      const double y = (j + 0.5) * cell - reach;
      double left = reach, right = -reach;
      for (int k = 0; k < 3; ++k) {
        const Vector2d &a = p[k], &b = p[(k + 1) % 3];
        if ((a.y() > y) == (b.y() > y)) continue;
        const double x = a.x() + (y - a.y()) / (b.y() - a.y()) * (b.x() - a.x());
        left = std::min(left, x);
        right = std::max(right, x);
      }
      const int last = std::min<int>(raster_size - 1, static_cast<int>(std::floor(index(right))));
      for (int i = std::max(0, static_cast<int>(std::ceil(index(left)))); i <= last; ++i) {
        covered[static_cast<std::size_t>(j) * raster_size + i] = true;
      }
    }
  }
  return cell * cell * static_cast<double>(std::count(covered.begin(), covered.end(), true));
}

double flat_area(const Sheet& sheet) {
  double area = 0.0;
  for (int t = 0; t < sheet.triangles.rows(); ++t) {
    const Vector2d a = sheet.material_m.row(sheet.triangles(t, 0));
    area += 0.5 * cross(sheet.material_m.row(sheet.triangles(t, 1)).transpose() - a,
                        sheet.material_m.row(sheet.triangles(t, 2)).transpose() - a);
  }
  return area;
}

}  // namespace

DrapeProfile measure_drape(const Sheet& sheet, const Points& positions_m, const DrapeTest& test) {
  const double disc = std::numbers::pi * test.disc_radius_m * test.disc_radius_m;
  const double flat = flat_area(sheet);
  if (!(flat > disc)) throw InvalidInput("drape: the specimen is no larger than its disc");
  const std::vector<Vector2d> points = shadow_points(positions_m, test.centre_m);
  DrapeProfile profile;
  profile.radii_m = outline(points, sheet.triangles);
  profile.shadow_area_m2 = star_area(points, sheet.triangles, profile.radii_m);
  profile.star_shaped = profile.shadow_area_m2 >= 0.0;
  if (!profile.star_shaped) profile.shadow_area_m2 = raster_area(points, sheet.triangles);
  profile.coefficient = (profile.shadow_area_m2 - disc) / (flat - disc);
  return profile;
}

double shape_error_m(const Sheet& sheet_a, const Points& a_m, const Sheet& sheet_b,
                     const Points& b_m) {
  if (sheet_a.vertex_count() > sheet_b.vertex_count()) {
    return shape_error_m(sheet_b, b_m, sheet_a, a_m);
  }
  const auto low_a = sheet_a.material_m.colwise().minCoeff();
  const auto low_b = sheet_b.material_m.colwise().minCoeff();
  const auto high_a = sheet_a.material_m.colwise().maxCoeff();
  const auto high_b = sheet_b.material_m.colwise().maxCoeff();
  const double size = (high_a - low_a).norm();
  if ((low_a - low_b).norm() > 0.05 * size || (high_a - high_b).norm() > 0.05 * size) {
    throw InvalidInput(
        "the two shapes are not of the same piece of fabric: their (u, v) cover different ranges");
  }
  return (a_m - refine(sheet_b, b_m, sheet_a)).rowwise().norm().mean();
}

}  // namespace semblance
