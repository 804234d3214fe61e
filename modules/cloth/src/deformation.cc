#include "semblance/cloth/deformation.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

namespace semblance {
namespace {

bool is_fixed(const std::vector<bool>& fixed, int vertex) {
  return !fixed.empty() && fixed[vertex];
}

/// Rows of a grid, kind by kind. Areas are sums over the quads that are not clamped, so the terms
/// at borders and clamps have what lies inside only.
class GridRows {
 public:
  GridRows(const SheetGrid& grid, const std::vector<bool>& fixed, Deformation& out)
      : grid_(grid), fixed_(fixed), out_(out) {}

  void tension() {
    each_vertex([&](int i, int j) { edge(StrainKind::warp, i, j, 1, 0); });
    each_vertex([&](int i, int j) { edge(StrainKind::weft, i, j, 0, 1); });
  }

  void shear() {
    each_vertex([&](int i, int j) { cell(StrainKind::shear_warp, i, j, -1, 1, -1, 1); });
    each_vertex([&](int i, int j) { cell(StrainKind::shear_weft, i, j, -1, -1, 1, 1); });
  }

  void curvature() {
    each_vertex([&](int i, int j) { second_difference(StrainKind::bend_warp, i, j, 1, 0); });
    each_vertex([&](int i, int j) { second_difference(StrainKind::bend_weft, i, j, 0, 1); });
    each_vertex([&](int i, int j) { cell(StrainKind::twist, i, j, 1, -1, -1, 1); });
  }

  void interlaced() {
    each_vertex([&](int i, int j) { chord(i, j, 2, 0); });
    each_vertex([&](int i, int j) { chord(i, j, 0, 2); });
    each_vertex([&](int i, int j) { chord(i, j, 2, 2); });
    each_vertex([&](int i, int j) { chord(i, j, 2, -2); });
  }

 private:
  template <class Body>
  void each_vertex(const Body& body) {
    for (int j = 0; j < grid_.rows; ++j) {
      for (int i = 0; i < grid_.columns; ++i) body(i, j);
    }
  }

  bool inside(int i, int j) const {
    return i >= 0 && j >= 0 && i < grid_.columns && j < grid_.rows;
  }

  /// Area of the quad whose first corner is (i, j); none outside the sheet and under a clamp.
  double quad_area(int i, int j) const {
    if (!inside(i, j) || !inside(i + 1, j + 1)) return 0.0;
    const bool clamped =
        is_fixed(fixed_, grid_.vertex(i, j)) && is_fixed(fixed_, grid_.vertex(i + 1, j)) &&
        is_fixed(fixed_, grid_.vertex(i, j + 1)) && is_fixed(fixed_, grid_.vertex(i + 1, j + 1));
    return clamped ? 0.0 : grid_.warp_spacing_m * grid_.weft_spacing_m;
  }

  double vertex_area(int i, int j) const {
    return 0.25 *
           (quad_area(i, j) + quad_area(i - 1, j) + quad_area(i, j - 1) + quad_area(i - 1, j - 1));
  }

  double spacing(int di, int dj) const {
    return std::hypot(di * grid_.warp_spacing_m, dj * grid_.weft_spacing_m);
  }

  void edge(StrainKind kind, int i, int j, int di, int dj) {
    if (!inside(i + di, j + dj)) return;
    const double c = 1.0 / spacing(di, dj);
    const std::array entries{StrainEntry{grid_.vertex(i, j), -c},
                             StrainEntry{grid_.vertex(i + di, j + dj), c}};
    out_.add(kind, 0.5 * (quad_area(i, j) + quad_area(i - dj, j - di)), entries);
  }

  /// Signed mean over the quad's four corners, in the order (0,0), (1,0), (0,1), (1,1): first
  /// derivatives, or with the signs of a saddle the mixed second one.
  void cell(StrainKind kind, int i, int j, int s00, int s10, int s01, int s11) {
    const double area = quad_area(i, j);
    if (area == 0.0) return;
    const double hu = grid_.warp_spacing_m, hv = grid_.weft_spacing_m;
    const double c = kind == StrainKind::shear_warp   ? 0.5 / hu
                     : kind == StrainKind::shear_weft ? 0.5 / hv
                                                      : 1.0 / (hu * hv);
    const std::array entries{StrainEntry{grid_.vertex(i, j), c * s00},
                             StrainEntry{grid_.vertex(i + 1, j), c * s10},
                             StrainEntry{grid_.vertex(i, j + 1), c * s01},
                             StrainEntry{grid_.vertex(i + 1, j + 1), c * s11}};
    out_.add(kind, area, entries);
  }

  /// At a clamp's edge the turn between two spacings happens on the free one's half.
  void second_difference(StrainKind kind, int i, int j, int di, int dj) {
    if (!inside(i - di, j - dj) || !inside(i + di, j + dj)) return;
    const double before = quad_area(i - 1, j - 1) + quad_area(i - di, j - dj);
    const double after = quad_area(i, j) + quad_area(i - dj, j - di);
    const double length = spacing(di, dj) * (before == 0.0 || after == 0.0 ? 0.5 : 1.0);
    const double c = 1.0 / (spacing(di, dj) * length);
    const std::array entries{StrainEntry{grid_.vertex(i - di, j - dj), c},
                             StrainEntry{grid_.vertex(i, j), -2.0 * c},
                             StrainEntry{grid_.vertex(i + di, j + dj), c}};
    out_.add(kind, vertex_area(i, j), entries);
  }

  void chord(int i, int j, int di, int dj) {
    if (!inside(i + di, j + dj)) return;
    const double length = spacing(di, dj), c = 1.0 / length;
    const std::array entries{StrainEntry{grid_.vertex(i, j), -c},
                             StrainEntry{grid_.vertex(i + di, j + dj), c}};
    out_.add(StrainKind::interlaced, vertex_area(i + di / 2, j + dj / 2), entries, length);
  }

  const SheetGrid& grid_;
  const std::vector<bool>& fixed_;
  Deformation& out_;
};

/// For each triangle and corner the vertex beyond the opposite edge, or -1.
std::vector<std::array<int, 3>> opposite_vertices(const Triangles& triangles) {
  std::map<std::pair<int, int>, int> beyond;  // directed edge -> its triangle's third vertex
  for (int t = 0; t < triangles.rows(); ++t) {
    for (int k = 0; k < 3; ++k) {
      beyond[{triangles(t, (k + 1) % 3), triangles(t, (k + 2) % 3)}] = triangles(t, k);
    }
  }
  std::vector<std::array<int, 3>> opposite(triangles.rows());
  for (int t = 0; t < triangles.rows(); ++t) {
    for (int k = 0; k < 3; ++k) {
      const auto found = beyond.find({triangles(t, (k + 2) % 3), triangles(t, (k + 1) % 3)});
      opposite[t][k] = found == beyond.end() ? -1 : found->second;
    }
  }
  return opposite;
}

/// Rows of a triangle mesh, kind by kind.
class TriangleRows {
 public:
  TriangleRows(const Sheet& sheet, const std::vector<bool>& fixed, Deformation& out)
      : sheet_(sheet), fixed_(fixed), out_(out), opposite_(opposite_vertices(sheet.triangles)) {}

  void tension() {
    each_triangle([&](int t, double area) { gradient(StrainKind::warp, t, area, 0); });
    each_triangle([&](int t, double area) { gradient(StrainKind::weft, t, area, 1); });
  }

  void shear() {
    each_triangle([&](int t, double area) { gradient(StrainKind::shear_warp, t, area, 0); });
    each_triangle([&](int t, double area) { gradient(StrainKind::shear_weft, t, area, 1); });
  }

  void curvature() {
    each_triangle([&](int t, double area) { patch(StrainKind::bend_warp, t, area, 0); });
    each_triangle([&](int t, double area) { patch(StrainKind::bend_weft, t, area, 1); });
    each_triangle([&](int t, double area) { patch(StrainKind::twist, t, area, 2); });
  }

  /// Chords across each edge, with a third of the two triangles around it (mirages-2006, 5.3.4.3).
  void interlaced() {
    each_triangle([&](int t, double area) {
      for (int k = 0; k < 3; ++k) {
        const int a = sheet_.triangles(t, k), b = opposite_[t][k];
        if (b < a) continue;  // every inner edge is met from both sides
        const double length = (sheet_.material_m.row(a) - sheet_.material_m.row(b)).norm();
        const std::array entries{StrainEntry{a, -1.0 / length}, StrainEntry{b, 1.0 / length}};
        out_.add(StrainKind::interlaced, 2.0 / 3.0 * area, entries, length);
      }
    });
  }

 private:
  template <class Body>
  void each_triangle(const Body& body) {
    for (int t = 0; t < sheet_.triangles.rows(); ++t) {
      const Eigen::Vector3i v = sheet_.triangles.row(t);
      if (is_fixed(fixed_, v[0]) && is_fixed(fixed_, v[1]) && is_fixed(fixed_, v[2])) continue;
      body(t, 0.5 * std::abs(edges(t).determinant()));
    }
  }

  Eigen::Matrix2d edges(int t) const {
    const Eigen::Vector2d a = sheet_.material_m.row(sheet_.triangles(t, 0));
    Eigen::Matrix2d e;
    e.col(0) = sheet_.material_m.row(sheet_.triangles(t, 1)).transpose() - a;
    e.col(1) = sheet_.material_m.row(sheet_.triangles(t, 2)).transpose() - a;
    return e;
  }

  /// Column of the deformation gradient, constant over the triangle.
  void gradient(StrainKind kind, int t, double area, int axis) {
    const Eigen::Vector2d c = edges(t).inverse().col(axis);
    const std::array entries{StrainEntry{sheet_.triangles(t, 0), -c[0] - c[1]},
                             StrainEntry{sheet_.triangles(t, 1), c[0]},
                             StrainEntry{sheet_.triangles(t, 2), c[1]}};
    out_.add(kind, area, entries);
  }

  /// Second derivatives (uu, vv, uv) of the quadratic through a triangle and the vertices across
  /// its edges. Where a border leaves fewer than six vertices it is the one of least curvature,
  /// which is the natural condition there. Across the edge of a clamp the quadratic has the clamp's
  /// slope in the edge's middle: all of the turn happens on the free side. On a split grid these
  /// are the grid's own differences.
  void patch(StrainKind kind, int t, double area, int which) {
    std::vector<int> vertices(sheet_.triangles.row(t).begin(), sheet_.triangles.row(t).end());
    std::vector<int> across;  // the corner that each further vertex lies opposite to
    for (int k = 0; k < 3; ++k) {
      if (opposite_[t][k] < 0) continue;
      vertices.push_back(opposite_[t][k]);
      across.push_back(k);
    }
    const Eigen::Vector2d a = sheet_.material_m.row(vertices[0]);
    const Eigen::Matrix2d slope = edges(t).inverse();
    const double scale = std::sqrt(area);
    const int extra = static_cast<int>(vertices.size()) - 3;
    if (extra == 0) return;
    // Height above the triangle's own plane: linear in the vertices on the left, in the three
    // derivatives on the right. Both vanish at the triangle's corners.
    Eigen::MatrixXd heights = Eigen::MatrixXd::Zero(extra, 3 + extra);
    Eigen::MatrixXd shapes(extra, 3);
    const auto quadratic = [&](const Eigen::Vector2d& p) {
      return Eigen::RowVector3d(0.5 * p.x() * p.x(), 0.5 * p.y() * p.y(), p.x() * p.y());
    };
    const Eigen::Matrix2d e = edges(t);
    const auto above_plane = [&](const Eigen::RowVector3d& value, const Eigen::Vector2d& s) {
      return Eigen::RowVector3d((value - s[0] * quadratic(e.col(0)) - s[1] * quadratic(e.col(1))) /
                                (scale * scale));
    };
    for (int k = 0; k < extra; ++k) {
      const Eigen::Vector2d p = sheet_.material_m.row(vertices[3 + k]).transpose() - a;
      const Eigen::Vector2d s = slope * p;  // barycentric
      heights(k, 0) = -(1.0 - s[0] - s[1]);
      heights(k, 1) = -s[0];
      heights(k, 2) = -s[1];
      heights(k, 3 + k) = 1.0;
      shapes.row(k) = above_plane(quadratic(p), s);
      const int first = vertices[(across[k] + 1) % 3], second = vertices[(across[k] + 2) % 3];
      if (!is_fixed(fixed_, vertices[3 + k]) || !is_fixed(fixed_, first) ||
          !is_fixed(fixed_, second))
        continue;
      // The height is the way from the edge to the vertex times the change of slope at the edge.
      const Eigen::Vector2d from = sheet_.material_m.row(first).transpose() - a;
      const Eigen::Vector2d to = sheet_.material_m.row(second).transpose() - a;
      const Eigen::Vector2d along = (to - from).normalized(), m = 0.5 * (from + to);
      const Eigen::Vector2d way = p - from - along * along.dot(p - from);
      shapes.row(k) = above_plane(
          {m.x() * way.x(), m.y() * way.y(), m.x() * way.y() + m.y() * way.x()}, slope * way);
    }
    // Twist counts twice in the norm of the second derivatives.
    shapes.col(2) /= std::sqrt(2.0);
    Eigen::MatrixXd c =
        shapes.completeOrthogonalDecomposition().pseudoInverse() * heights / (scale * scale);
    c.row(2) /= std::sqrt(2.0);
    std::vector<StrainEntry> entries;
    for (int k = 0; k < 3 + extra; ++k) {
      if (std::abs(c(which, k)) * scale * scale > 1e-12) {
        entries.push_back({vertices[k], c(which, k)});
      }
    }
    out_.add(kind, entries.empty() ? 0.0 : area, entries);
  }

  const Sheet& sheet_;
  const std::vector<bool>& fixed_;
  Deformation& out_;
  std::vector<std::array<int, 3>> opposite_;
};

template <class Rows>
void add_rows(Rows rows, BendingModel bending) {
  rows.tension();
  rows.shear();
  if (bending == BendingModel::curvature) {
    rows.curvature();
  } else {
    rows.interlaced();
  }
}

}  // namespace

void Deformation::add(StrainKind kind, double area_m2, std::span<const StrainEntry> entries,
                      double length_m) {
  if (area_m2 <= 0.0) return;
  entries_.insert(entries_.end(), entries.begin(), entries.end());
  begin_.push_back(static_cast<int>(entries_.size()));
  area_m2_.push_back(area_m2);
  length_m_.push_back(length_m);
  std::fill(first_.begin() + static_cast<int>(kind) + 1, first_.end(), row_count());
}

Deformation deformation_of(const Sheet& sheet, BendingModel bending,
                           const std::vector<bool>& fixed) {
  Deformation out;
  if (sheet.grid) {
    add_rows(GridRows(*sheet.grid, fixed, out), bending);
  } else {
    add_rows(TriangleRows(sheet, fixed, out), bending);
  }
  return out;
}

}  // namespace semblance
