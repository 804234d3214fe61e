#include "semblance/cloth/sheet.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

constexpr int most_triangles_at_vertex = 64;

double signed_area(const Sheet& sheet, int t) {
  const Eigen::Vector2d a = sheet.material_m.row(sheet.triangles(t, 0));
  const Eigen::Vector2d ab = sheet.material_m.row(sheet.triangles(t, 1)).transpose() - a;
  const Eigen::Vector2d ac = sheet.material_m.row(sheet.triangles(t, 2)).transpose() - a;
  return 0.5 * (ab.x() * ac.y() - ab.y() * ac.x());
}

int divisions(double side_m, double spacing_m, const char* name) {
  if (!(spacing_m > 0.0) || !(side_m >= 2.0 * spacing_m * (1.0 - 1e-9))) {
    throw InvalidInput(fmt::format(
        "sheet: {} {} m with spacing {} m: at least two spacings must fit into each side", name,
        side_m, spacing_m));
  }
  return static_cast<int>(std::lround(side_m / spacing_m));
}

/// Two triangles to each quad; the diagonals alternate, so that contact favours no direction.
Triangles split_quads(const SheetGrid& grid) {
  Triangles triangles(2 * (grid.columns - 1) * (grid.rows - 1), 3);
  int t = 0;
  for (int j = 0; j + 1 < grid.rows; ++j) {
    for (int i = 0; i + 1 < grid.columns; ++i) {
      const int a = grid.vertex(i, j), b = a + 1, d = grid.vertex(i, j + 1), c = d + 1;
      if ((i + j) % 2 == 0) {
        triangles.row(t++) << a, b, c;
        triangles.row(t++) << a, c, d;
      } else {
        triangles.row(t++) << a, b, d;
        triangles.row(t++) << b, c, d;
      }
    }
  }
  return triangles;
}

bool is_upright(const Sheet& sheet, int t) {
  const Eigen::Vector2d side =
      sheet.material_m.row(sheet.triangles(t, 1)) - sheet.material_m.row(sheet.triangles(t, 0));
  return signed_area(sheet, t) > 1e-9 * side.squaredNorm();
}

/// How many triangles are inverted or without area.
Eigen::Index not_upright(const Sheet& sheet) {
  Eigen::Index count = 0;
  for (int t = 0; t < sheet.triangles.rows(); ++t) count += is_upright(sheet, t) ? 0 : 1;
  return count;
}

void check_upright(const Sheet& sheet, int t, const std::string& source) {
  if (is_upright(sheet, t)) return;
  const Eigen::Index all = sheet.triangles.rows(), wrong = not_upright(sheet);
  throw InvalidInput(fmt::format(
      "{}: triangle {} is {} in the fabric ({} of {} triangles are wrong so); all must be "
      "counter-clockwise in (u, v) and have an area: {}",
      source, t + 1, signed_area(sheet, t) < 0.0 ? "inverted" : "without area", wrong, all,
      wrong == all ? "turn the triangles round, or mirror the texture coordinates"
                   : "mend the texture coordinates"));
}

}  // namespace

Eigen::VectorXd Sheet::vertex_areas_m2() const {
  Eigen::VectorXd areas = Eigen::VectorXd::Zero(vertex_count());
  if (grid) {
    const double quarter = 0.25 * grid->warp_spacing_m * grid->weft_spacing_m;
    for (int j = 0; j + 1 < grid->rows; ++j) {
      for (int i = 0; i + 1 < grid->columns; ++i) {
        for (const int v : {grid->vertex(i, j), grid->vertex(i + 1, j), grid->vertex(i, j + 1),
                            grid->vertex(i + 1, j + 1)}) {
          areas[v] += quarter;
        }
      }
    }
    return areas;
  }
  for (int t = 0; t < triangles.rows(); ++t) {
    for (int k = 0; k < 3; ++k) areas[triangles(t, k)] += signed_area(*this, t) / 3.0;
  }
  return areas;
}

Mesh Sheet::mesh(const Points& positions_m) const {
  Mesh mesh;
  mesh.positions_m = positions_m;
  mesh.triangles = triangles;
  const Eigen::RowVector2d low = material_m.colwise().minCoeff();
  const double side = (material_m.colwise().maxCoeff() - low).maxCoeff();
  mesh.uvs = ((material_m.rowwise() - low) / side).cast<float>();
  return mesh;
}

Sheet make_rectangle(double warp_m, double weft_m, double spacing_m) {
  SheetGrid grid;
  const int along = divisions(warp_m, spacing_m, "warp side");
  const int across = divisions(weft_m, spacing_m, "weft side");
  if (static_cast<double>(along + 1) * (across + 1) > 16e6) {
    throw InvalidInput(
        fmt::format("sheet: {} x {} quads are too many; choose a wider spacing", along, across));
  }
  grid.columns = along + 1;
  grid.rows = across + 1;
  grid.warp_spacing_m = warp_m / along;
  grid.weft_spacing_m = weft_m / across;
  Sheet sheet;
  sheet.material_m.resize(grid.columns * grid.rows, 2);
  for (int j = 0; j < grid.rows; ++j) {
    for (int i = 0; i < grid.columns; ++i) {
      sheet.material_m.row(grid.vertex(i, j)) << i * grid.warp_spacing_m, j * grid.weft_spacing_m;
    }
  }
  sheet.triangles = split_quads(grid);
  sheet.grid = grid;
  return sheet;
}

Sheet make_sheet(const Mesh& mesh, const std::string& source) {
  if (mesh.uvs.rows() != mesh.vertex_count()) {
    throw InvalidInput(source +
                       ": the mesh has no texture coordinates; a cloth needs them, in metres, as "
                       "places in the fabric (u along the warp, v along the weft)");
  }
  Sheet sheet;
  sheet.material_m = mesh.uvs.cast<double>();
  sheet.triangles = mesh.triangles;
  validate(sheet, source);
  return sheet;
}

void validate(const Sheet& sheet, const std::string& source) {
  std::vector<int> triangles_at(sheet.vertex_count(), 0);
  std::map<std::pair<int, int>, int> edges;  // directed
  for (int t = 0; t < sheet.triangles.rows(); ++t) {
    check_upright(sheet, t, source);
    for (int k = 0; k < 3; ++k) {
      const int a = sheet.triangles(t, k), b = sheet.triangles(t, (k + 1) % 3);
      ++triangles_at[a];
      if (!edges.emplace(std::make_pair(a, b), t).second) {
        throw InvalidInput(
            fmt::format("{}: triangles {} and {} run through the edge of vertices {} and {} in the "
                        "same direction: the mesh is not a manifold surface; each edge may have "
                        "two triangles, on either side: remove one, or turn it round",
                        source, edges.at({a, b}) + 1, t + 1, a + 1, b + 1));
      }
    }
  }
  const auto crowded = std::max_element(triangles_at.begin(), triangles_at.end());
  if (crowded != triangles_at.end() && *crowded > most_triangles_at_vertex) {
    throw InvalidInput(fmt::format(
        "{}: vertex {} is a corner of {} triangles, more than {}: its row of the "
        "equations would couple all of them; mesh the sheet more evenly",
        source, crowded - triangles_at.begin() + 1, *crowded, most_triangles_at_vertex));
  }
  const auto unused = std::find(triangles_at.begin(), triangles_at.end(), 0);
  if (unused != triangles_at.end()) {
    throw InvalidInput(fmt::format("{}: vertex {} belongs to no triangle; remove it", source,
                                   unused - triangles_at.begin() + 1));
  }
}

}  // namespace semblance
