// Round sheets, from a rectangular one by cutting it along circles.
//
// Triangles with two sides along the yarns have one condition of length for each piece of yarn, as
// quads have. Triangles in any other direction have twice as many conditions as that, more than the
// vertices have freedom: sheets of them resist folding although each triangle may turn freely
// (membrane locking). So only triangles along the circles are of that kind.
#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "semblance/cloth/sheet.h"

namespace semblance {
namespace {

using Eigen::Vector2d;

/// Nearer vertices move onto the circle, so that no triangle gets thin.
constexpr double snap_distance = 0.3;  // over the spacing

class Cutter {
 public:
  Cutter(const Sheet& sheet, double spacing_m) : spacing_m_(spacing_m) {
    for (const auto& place : sheet.material_m.rowwise()) places_m_.emplace_back(place);
    for (const auto& corners : sheet.triangles.rowwise()) triangles_.emplace_back(corners);
  }

  /// Makes edges run along a circle about (0, 0).
  void cut(double radius_m) {
    side_.clear();
    for (Vector2d& p : places_m_) {
      const double outside_m = p.norm() - radius_m;
      const bool near = std::abs(outside_m) < snap_distance * spacing_m_;
      if (near) p *= radius_m / p.norm();
      side_.push_back(near ? 0 : outside_m > 0.0 ? 1 : -1);
    }
    const std::vector<Eigen::Vector3i> whole = std::exchange(triangles_, {});
    crossings_.clear();
    for (const Eigen::Vector3i& t : whole) split(t, radius_m);
  }

  /// What lies inside the last circle.
  Sheet inside() const {
    std::vector<int> index(places_m_.size(), -1);
    std::vector<int> kept;
    std::vector<Eigen::Vector3i> triangles;
    for (Eigen::Vector3i t : triangles_) {
      if (side_[t[0]] > 0 || side_[t[1]] > 0 || side_[t[2]] > 0) continue;
      for (int& v : t) {
        if (index[v] < 0) {
          index[v] = static_cast<int>(kept.size());
          kept.push_back(v);
        }
        v = index[v];
      }
      triangles.push_back(t);
    }
    Sheet sheet;
    sheet.material_m.resize(static_cast<Eigen::Index>(kept.size()), 2);
    for (std::size_t i = 0; i < kept.size(); ++i) sheet.material_m.row(i) = places_m_[kept[i]];
    sheet.triangles.resize(static_cast<Eigen::Index>(triangles.size()), 3);
    for (std::size_t t = 0; t < triangles.size(); ++t) sheet.triangles.row(t) = triangles[t];
    return sheet;
  }

 private:
  void split(const Eigen::Vector3i& t, double radius_m) {
    for (int k = 0; k < 3; ++k) {
      const int a = t[k], b = t[(k + 1) % 3], c = t[(k + 2) % 3];
      // A corner on the circle, and the others on either side of it.
      if (side_[a] == 0 && side_[b] * side_[c] < 0) {
        const int m = crossing(b, c, radius_m);
        triangles_.insert(triangles_.end(), {{a, b, m}, {a, m, c}});
        return;
      }
      // A corner alone on its side.
      if (side_[a] * side_[b] < 0 && side_[a] * side_[c] < 0) {
        const int m = crossing(a, b, radius_m), n = crossing(a, c, radius_m);
        triangles_.emplace_back(a, m, n);
        const bool from_b =
            (places_m_[b] - places_m_[n]).norm() < (places_m_[c] - places_m_[m]).norm();
        from_b ? triangles_.insert(triangles_.end(), {{m, b, n}, {b, c, n}})
               : triangles_.insert(triangles_.end(), {{m, b, c}, {m, c, n}});
        return;
      }
    }
    triangles_.push_back(t);
  }

  /// The vertex where the side from a to b passes the circle.
  int crossing(int a, int b, double radius_m) {
    const auto [at, is_new] =
        crossings_.emplace(std::minmax(a, b), static_cast<int>(places_m_.size()));
    if (is_new) {
      if (side_[a] > 0) std::swap(a, b);
      const Vector2d from = places_m_[a], way = places_m_[b] - from;
      const double middle = from.dot(way) / way.squaredNorm();
      const double room = (radius_m * radius_m - from.squaredNorm()) / way.squaredNorm();
      places_m_.push_back(from + (std::sqrt(middle * middle + room) - middle) * way);
      side_.push_back(0);
    }
    return at->second;
  }

  double spacing_m_;
  std::vector<Vector2d> places_m_;
  std::vector<Eigen::Vector3i> triangles_;
  std::vector<int> side_;  // of the circle: -1 inside, 0 on it, 1 outside
  std::map<std::pair<int, int>, int> crossings_;
};

}  // namespace

Sheet make_disc(double radius_m, double spacing_m, double inner_radius_m) {
  const double side_m = 2.0 * radius_m;
  Sheet square = make_rectangle(side_m, side_m, spacing_m);
  square.material_m.array() -= radius_m;
  Cutter cutter(square, square.grid->warp_spacing_m);
  if (inner_radius_m > 0.0) cutter.cut(inner_radius_m);
  cutter.cut(radius_m);
  return cutter.inside();
}

}  // namespace semblance
