#include "semblance/core/pack_uvs.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <vector>

#include "semblance/core/errors.h"

namespace semblance {

namespace {

/// Triangles of one texture chart: those connected by vertices, in one unit square.
struct Chart {
  Eigen::RowVector2f tile = Eigen::RowVector2f::Zero();  // lower corner of the square
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
    chart.tile = (0.5f * (low + high)).array().floor();
    constexpr float kSlack = 1e-3f;
    if (!((low - chart.tile).minCoeff() >= -kSlack &&
          (high - chart.tile).maxCoeff() <= 1.0f + kSlack)) {
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
  explicit Sheet(const Chart& first) : tile(first.tile) {}

  /// Takes the chart unless more than a hundredth of it is covered already.
  bool take(const Mesh& mesh, const Chart& chart) {
    if (chart.tile != tile) return false;
    const std::vector<int> cells = cells_under(mesh, chart);
    const auto covered = std::count_if(cells.begin(), cells.end(), [&](int c) { return full_[c]; });
    if (100 * covered > static_cast<std::ptrdiff_t>(cells.size())) return false;
    for (int c : cells) full_[c] = true;
    charts.push_back(&chart);
    return true;
  }

  Eigen::RowVector2f tile;
  std::vector<const Chart*> charts;

 private:
  static constexpr int kCells = 256;

  std::vector<int> cells_under(const Mesh& mesh, const Chart& chart) const {
    std::vector<int> out;
    for (Eigen::Index t : chart.triangles) {
      Eigen::Vector2f p[3];
      for (int k = 0; k < 3; ++k) {
        p[k] = kCells * (mesh.uvs.row(mesh.triangles(t, k)) - tile).transpose();
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
  if (sheets.size() == 1 && sheets[0].tile.isZero(0.0f)) return;
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
    const Eigen::RowVector2f corner(column * small, row * small);
    for (int v : vertices) mesh.uvs.row(v) = corner + size * (mesh.uvs.row(v) - sheet.tile).eval();
  }
}

}  // namespace semblance
