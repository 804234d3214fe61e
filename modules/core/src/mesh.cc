#include "semblance/core/mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <vector>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

// Four lanes for three coordinates, so that every load, product and store is one instruction.
using Float4 = float __attribute__((vector_size(16)));

Float4 cross(Float4 a, Float4 b) {
  const Float4 a_yzx = __builtin_shufflevector(a, a, 1, 2, 0, 3);
  const Float4 b_yzx = __builtin_shufflevector(b, b, 1, 2, 0, 3);
  const Float4 c = a * b_yzx - a_yzx * b;
  return __builtin_shufflevector(c, c, 1, 2, 0, 3);
}

/// Adds a triangle's normal, as long as twice its area, to the sums of its corners.
void add_normal(const Float4* points, const int* corner, Float4* sums) {
  const Float4 a = points[corner[0]];
  const Float4 normal = cross(points[corner[1]] - a, points[corner[2]] - a);
  for (int k = 0; k < 3; ++k) sums[corner[k]] += normal;
}

/// What scales each of four vectors to unit length; finite for zero.
Eigen::Array4f inverse_lengths(const Float4* vectors) {
  const Float4 a = vectors[0] * vectors[0], b = vectors[1] * vectors[1];
  const Float4 c = vectors[2] * vectors[2], d = vectors[3] * vectors[3];
  const Float4 ab = __builtin_shufflevector(a, b, 0, 4, 1, 5);
  const Float4 cd = __builtin_shufflevector(c, d, 0, 4, 1, 5);
  const Float4 x = __builtin_shufflevector(ab, cd, 0, 1, 4, 5);
  const Float4 y = __builtin_shufflevector(ab, cd, 2, 3, 6, 7);
  const Float4 z = __builtin_shufflevector(__builtin_shufflevector(a, b, 2, 6, 3, 7),
                                           __builtin_shufflevector(c, d, 2, 6, 3, 7), 0, 1, 4, 5);
  const Float4 squared = x + y + z;
  Eigen::Array4f lengths;
  __builtin_memcpy(lengths.data(), &squared, sizeof squared);
  return lengths.max(1e-36f).sqrt().inverse();
}

void check_positions(const Mesh& mesh, const std::string& source) {
  for (Eigen::Index i = 0; i < mesh.vertex_count(); ++i) {
    if (mesh.positions_m.row(i).allFinite()) continue;
    throw InvalidInput(fmt::format(
        "{}: the position of vertex {} (counted from 0) is ({}, {}, {}); every coordinate must be "
        "finite. Repair the vertex in the program that wrote the mesh",
        source, i, mesh.positions_m(i, 0), mesh.positions_m(i, 1), mesh.positions_m(i, 2)));
  }
}

void check_triangles(const Mesh& mesh, const std::string& source) {
  for (Eigen::Index i = 0; i < mesh.triangle_count(); ++i) {
    const int a = mesh.triangles(i, 0), b = mesh.triangles(i, 1), c = mesh.triangles(i, 2);
    for (const int vertex : {a, b, c}) {
      if (vertex >= 0 && vertex < mesh.vertex_count()) continue;
      throw InvalidInput(fmt::format(
          "{}: triangle {} (counted from 0) names vertex {}; there are {} vertices, so indices "
          "must lie in 0 to {}",
          source, i, vertex, mesh.vertex_count(), mesh.vertex_count() - 1));
    }
    if (a == b || b == c || c == a) {
      throw InvalidInput(fmt::format(
          "{}: triangle {} (counted from 0) uses a vertex twice ({}, {}, {}); remove degenerate "
          "triangles",
          source, i, a, b, c));
    }
  }
}

}  // namespace

void validate(const Mesh& mesh, const std::string& source) {
  check_positions(mesh, source);
  check_triangles(mesh, source);
  if (mesh.uvs.rows() != 0 && mesh.uvs.rows() != mesh.vertex_count()) {
    throw InvalidInput(fmt::format(
        "{}: there are {} texture coordinates for {} vertices; give none, or one per vertex",
        source, mesh.uvs.rows(), mesh.vertex_count()));
  }
  if (!mesh.uvs.allFinite()) {
    throw InvalidInput(fmt::format("{}: a texture coordinate is not finite", source));
  }
}

namespace {

/// Triangles of one texture chart: those connected by vertices, in one unit square.
struct Chart {
  int tile_x = 0, tile_y = 0;
  std::vector<Eigen::Index> triangles;
};

/// Charts, those of most triangles first.
std::vector<Chart> charts_of(const Mesh& mesh, const std::string& source) {
  std::vector<int> parent(static_cast<std::size_t>(mesh.vertex_count()));
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](int v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  for (Eigen::Index t = 0; t < mesh.triangle_count(); ++t) {
    for (int k = 1; k < 3; ++k) parent[root(mesh.triangles(t, k))] = root(mesh.triangles(t, 0));
  }
  std::map<int, Chart> charts;
  for (Eigen::Index t = 0; t < mesh.triangle_count(); ++t) {
    charts[root(mesh.triangles(t, 0))].triangles.push_back(t);
  }
  std::vector<Chart> out;
  for (auto& [first, chart] : charts) {
    Eigen::RowVector2f low = mesh.uvs.row(first), high = low;
    for (Eigen::Index t : chart.triangles) {
      for (int k = 0; k < 3; ++k) {
        low = low.cwiseMin(mesh.uvs.row(mesh.triangles(t, k)));
        high = high.cwiseMax(mesh.uvs.row(mesh.triangles(t, k)));
      }
    }
    // The middle decides: charts may end on the very border.
    chart.tile_x = static_cast<int>(std::floor(0.5f * (low.x() + high.x())));
    chart.tile_y = static_cast<int>(std::floor(0.5f * (low.y() + high.y())));
    constexpr float kSlack = 1e-3f;
    const Eigen::RowVector2f tile(static_cast<float>(chart.tile_x),
                                  static_cast<float>(chart.tile_y));
    if ((low - tile).minCoeff() < -kSlack || (high - tile).maxCoeff() > 1.0f + kSlack) {
      throw InvalidInput(source + ": its texture coordinates lie across the border of two unit " +
                         "squares; each connected piece should stay within one");
    }
    out.push_back(std::move(chart));
  }
  std::stable_sort(out.begin(), out.end(), [](const Chart& a, const Chart& b) {
    return a.triangles.size() > b.triangles.size();
  });
  return out;
}

/// One unit square of texture whose charts do not overlap.
class Sheet {
 public:
  explicit Sheet(const Chart& first) : tile_x(first.tile_x), tile_y(first.tile_y) {}

  /// Takes the chart unless more than a hundredth of it is covered already.
  bool take(const Mesh& mesh, const Chart& chart) {
    if (chart.tile_x != tile_x || chart.tile_y != tile_y) return false;
    const std::vector<int> cells = cells_under(mesh, chart);
    const auto covered = std::count_if(cells.begin(), cells.end(), [&](int c) { return full_[c]; });
    if (100 * covered > static_cast<std::ptrdiff_t>(cells.size())) return false;
    for (int c : cells) full_[c] = true;
    charts.push_back(&chart);
    return true;
  }

  int tile_x, tile_y;
  std::vector<const Chart*> charts;

 private:
  static constexpr int kCells = 256;

  std::vector<int> cells_under(const Mesh& mesh, const Chart& chart) const {
    std::vector<int> out;
    for (Eigen::Index t : chart.triangles) {
      Eigen::Vector2f p[3];
      for (int k = 0; k < 3; ++k) {
        p[k] = {(mesh.uvs(mesh.triangles(t, k), 0) - static_cast<float>(tile_x)) * kCells,
                (mesh.uvs(mesh.triangles(t, k), 1) - static_cast<float>(tile_y)) * kCells};
      }
      const Eigen::Vector2f a = p[1] - p[0], b = p[2] - p[0];
      const float area = a.x() * b.y() - a.y() * b.x();
      if (!(std::abs(area) > 1e-9f)) continue;
      const Eigen::Vector2f low = p[0].cwiseMin(p[1]).cwiseMin(p[2]);
      const Eigen::Vector2f high = p[0].cwiseMax(p[1]).cwiseMax(p[2]);
      const int x1 = std::min(kCells - 1, static_cast<int>(high.x()));
      const int y1 = std::min(kCells - 1, static_cast<int>(high.y()));
      for (int y = std::max(0, static_cast<int>(low.y())); y <= y1; ++y) {
        for (int x = std::max(0, static_cast<int>(low.x())); x <= x1; ++x) {
          const Eigen::Vector2f d = Eigen::Vector2f(x + 0.5f, y + 0.5f) - p[0];
          const float b1 = (d.x() * b.y() - d.y() * b.x()) / area;
          const float b2 = (a.x() * d.y() - a.y() * d.x()) / area;
          if (b1 >= 0.0f && b2 >= 0.0f && b1 + b2 <= 1.0f) out.push_back(y * kCells + x);
        }
      }
    }
    return out;
  }

  std::vector<bool> full_ = std::vector<bool>(kCells * kCells, false);
};

}  // namespace

void pack_uvs(Mesh& mesh, const std::string& source) {
  if (mesh.uvs.rows() == 0 || mesh.triangle_count() == 0) return;
  const std::vector<Chart> charts = charts_of(mesh, source);
  std::vector<Sheet> sheets;
  for (const Chart& chart : charts) {
    if (std::any_of(sheets.begin(), sheets.end(),
                    [&](Sheet& sheet) { return sheet.take(mesh, chart); }))
      continue;
    sheets.emplace_back(chart);
    sheets.back().take(mesh, chart);
  }
  if (sheets.size() == 1 && sheets[0].tile_x == 0 && sheets[0].tile_y == 0) return;
  // `side` small squares fit along the main one, and one more in the corner.
  const int side = std::max(3, static_cast<int>(sheets.size() - 1) / 2);
  const float small = 1.0f / static_cast<float>(side + 1);
  for (int i = 0; i < static_cast<int>(sheets.size()); ++i) {
    const Sheet& sheet = sheets[static_cast<std::size_t>(i)];
    const int n = i - 1;  // up the right border, then back along the upper one
    const float column = static_cast<float>(i == 0 ? 0 : n <= side ? side : 2 * side - n);
    const float row = static_cast<float>(i == 0 ? 0 : std::min(n, side));
    const float size = i == 0 ? 1.0f - small : small;
    std::set<int> vertices;
    for (const Chart* chart : sheet.charts) {
      for (Eigen::Index t : chart->triangles) {
        for (int k = 0; k < 3; ++k) vertices.insert(mesh.triangles(t, k));
      }
    }
    for (int v : vertices) {
      mesh.uvs(v, 0) = column * small + size * (mesh.uvs(v, 0) - static_cast<float>(sheet.tile_x));
      mesh.uvs(v, 1) = row * small + size * (mesh.uvs(v, 1) - static_cast<float>(sheet.tile_y));
    }
  }
}

void vertex_normals(const PointsF& positions_m,
                    const Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>& triangles,
                    PointsF& normals) {
  // The scratch memory is kept because fresh pages would cost as much as the work.
  thread_local std::vector<Float4> points_scratch, sums_scratch;
  const Eigen::Index count = positions_m.rows();
  points_scratch.resize(count);
  sums_scratch.assign(count + 4, Float4{});  // whole groups of four
  Float4* const points = points_scratch.data();
  Float4* const sums = sums_scratch.data();
  const float* p = positions_m.data();
  for (Eigen::Index i = 0; i < count; ++i, p += 3) points[i] = Float4{p[0], p[1], p[2], 0.0f};
  // Neighbours in the list share corners, and each would wait for the other's sum: two at a time,
  // from far apart.
  const Eigen::Index half = triangles.rows() / 2;
  const int* const corners = triangles.data();
  for (Eigen::Index i = 0; i < half; ++i) {
    add_normal(points, corners + 3 * i, sums);
    add_normal(points, corners + 3 * (half + i), sums);
  }
  if (triangles.rows() % 2 != 0) add_normal(points, corners + 6 * half, sums);
  normals.resize(count, 3);
  float* const n = normals.data();
  const auto write = [&](Eigen::Index i, float scale) {
    const Float4 unit = scale * sums[i];
    for (int k = 0; k < 3; ++k) n[3 * i + k] = unit[k];
  };
  Eigen::Index i = 0;
  for (; i + 4 <= count; i += 4) {
    const Eigen::Array4f scale = inverse_lengths(sums + i);
    for (int k = 0; k < 4; ++k) write(i + k, scale[k]);
  }
  const Eigen::Array4f scale = inverse_lengths(sums + i);
  for (int k = 0; i + k < count; ++k) write(i + k, scale[k]);
}

}  // namespace semblance
