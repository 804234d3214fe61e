#include "semblance/cloth/deformation.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
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
      : sheet_(sheet), fixed_(fixed), out_(out), opposite_(opposite_vertices(sheet.triangles)) {
    around_.resize(sheet.vertex_count());
    for (int t = 0; t < sheet.triangles.rows(); ++t) {
      for (const int v : sheet.triangles.row(t)) around_[v].push_back(t);
    }
  }

  void tension() {
    each_triangle([&](int t, double area) { gradient(StrainKind::warp, t, area, 0); });
    each_triangle([&](int t, double area) { gradient(StrainKind::weft, t, area, 1); });
  }

  void shear() {
    each_triangle([&](int t, double area) { gradient(StrainKind::shear_warp, t, area, 0); });
    each_triangle([&](int t, double area) { gradient(StrainKind::shear_weft, t, area, 1); });
  }

  void curvature() {
    each_vertex([&](int v) { second_derivative(StrainKind::bend_warp, v, 0); });
    each_vertex([&](int v) { second_derivative(StrainKind::bend_weft, v, 1); });
    each_vertex([&](int v) { second_derivative(StrainKind::twist, v, 2); });
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
      if (!is_clamped(t)) body(t, area_m2(t));
    }
  }

  template <class Body>
  void each_vertex(const Body& body) {
    for (int v = 0; v < sheet_.vertex_count(); ++v) body(v);
  }

  bool is_clamped(int t) const {
    const Eigen::Vector3i v = sheet_.triangles.row(t);
    return is_fixed(fixed_, v[0]) && is_fixed(fixed_, v[1]) && is_fixed(fixed_, v[2]);
  }

  double area_m2(int t) const { return 0.5 * std::abs(edges(t).determinant()); }

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

  /// The vertices that take part in a vertex's curvature, itself first, and what they stand for.
  struct Ring {
    std::vector<int> vertices;
    int neighbours = 0;  // that many after the first; behind them what else `clamp` needs
    double area_m2 = 0.0;
    int clamp = -1;  // a triangle of it, where the vertex lies at its edge
  };

  Ring ring_of(int v) const {
    Ring ring{{v}};
    const auto add = [&](int other) {
      if (std::find(ring.vertices.begin(), ring.vertices.end(), other) == ring.vertices.end())
        ring.vertices.push_back(other);
    };
    for (const int t : around_[v]) {
      if (is_clamped(t)) {
        ring.clamp = t;
        continue;
      }
      ring.area_m2 += area_m2(t) / 3.0;
      for (const int other : sheet_.triangles.row(t)) add(other);
    }
    // A closed ring must tell slopes and second derivatives, at a clamp the latter only. Where it
    // is too small, the vertices across its sides help.
    const std::size_t count = ring.vertices.size() - 1;
    const bool is_closed = count == around_[v].size();
    if (ring.clamp < 0 ? is_closed && count < 5 : count < 3) {
      for (const int t : around_[v]) {
        for (int k = 0; k < 3; ++k) {
          if (sheet_.triangles(t, k) == v && !is_clamped(t) && opposite_[t][k] >= 0)
            add(opposite_[t][k]);
        }
      }
    }
    ring.neighbours = static_cast<int>(ring.vertices.size()) - 1;
    if (ring.clamp >= 0) {
      for (const int other : sheet_.triangles.row(ring.clamp)) add(other);
    }
    return ring;
  }

  /// Second derivatives (uu, vv, uv) at a vertex: of the quadratic through it that comes nearest to
  /// its neighbours, and where they leave a choice, as on borders, of the one of least curvature,
  /// which is the natural condition there. At the edge of a clamp the quadratic has the clamp's
  /// slope: all of the turn happens on the free side. Every vertex has its own, so that no wave of
  /// the mesh goes unnoticed.
  void second_derivative(StrainKind kind, int v, int which) {
    const Ring ring = ring_of(v);
    if (ring.area_m2 == 0.0) return;
    const double scale = std::sqrt(ring.area_m2);
    const int count = ring.neighbours;
    const Eigen::Vector2d origin = sheet_.material_m.row(v);
    Eigen::MatrixXd heights = Eigen::MatrixXd::Zero(count, ring.vertices.size());
    Eigen::MatrixXd slopes(count, 2), shapes(count, 3);
    for (int k = 0; k < count; ++k) {
      const Eigen::Vector2d p =
          (sheet_.material_m.row(ring.vertices[1 + k]).transpose() - origin) / scale;
      heights(k, 0) = -1.0;
      heights(k, 1 + k) = 1.0;
      slopes.row(k) = p;
      // Twist counts twice in the norm of the second derivatives.
      shapes.row(k) << 0.5 * p.x() * p.x(), 0.5 * p.y() * p.y(),
          p.x() * p.y() / std::numbers::sqrt2;
    }
    if (ring.clamp >= 0) {
      heights -= scale * slopes * slope_of(ring);
    } else {
      // What any slope explains counts for nothing.
      const Eigen::MatrixXd rest =
          Eigen::MatrixXd::Identity(count, count) -
          slopes * slopes.completeOrthogonalDecomposition().pseudoInverse();
      heights = rest * heights;
      shapes = rest * shapes;
    }
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> fit;
    fit.setThreshold(1e-2);
    fit.compute(shapes);
    Eigen::RowVectorXd c = fit.pseudoInverse().row(which) * heights / (scale * scale);
    if (which == 2) c /= std::numbers::sqrt2;
    std::vector<StrainEntry> entries;
    for (Eigen::Index k = 0; k < c.size(); ++k) {
      if (std::abs(c[k]) * scale * scale > 1e-9) entries.push_back({ring.vertices[k], c[k]});
    }
    out_.add(kind, entries.empty() ? 0.0 : ring.area_m2, entries);
  }

  /// Both derivatives of the clamp's plane, by the vertices of its ring.
  Eigen::MatrixXd slope_of(const Ring& ring) const {
    Eigen::MatrixXd slope = Eigen::MatrixXd::Zero(2, ring.vertices.size());
    const Eigen::Matrix2d c = edges(ring.clamp).inverse().transpose();
    for (int k = 0; k < 3; ++k) {
      const auto at =
          std::find(ring.vertices.begin(), ring.vertices.end(), sheet_.triangles(ring.clamp, k)) -
          ring.vertices.begin();
      slope.col(at) =
          k == 0 ? Eigen::Vector2d(-c.col(0) - c.col(1)) : Eigen::Vector2d(c.col(k - 1));
    }
    return slope;
  }

  const Sheet& sheet_;
  const std::vector<bool>& fixed_;
  Deformation& out_;
  std::vector<std::array<int, 3>> opposite_;
  std::vector<std::vector<int>> around_;  // triangles of each vertex
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
