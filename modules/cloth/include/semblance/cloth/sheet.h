// Flat pieces of cloth: where each vertex lies in the fabric, and how vertices are joined.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "semblance/cloth/points.h"
#include "semblance/core/mesh.h"

namespace semblance {

/// Rows are vertices.
using MaterialPoints = Eigen::Matrix<double, Eigen::Dynamic, 2, Eigen::RowMajor>;

/// Regular quads: vertex (i, j) is number j * columns + i; i counts along the warp.
struct SheetGrid {
  int columns = 0;
  int rows = 0;
  double warp_spacing_m = 0.0;
  double weft_spacing_m = 0.0;

  int vertex(int i, int j) const { return j * columns + i; }
};

/// A piece of cloth at rest. `material_m` holds (u, v), u along the warp and v along the weft.
/// Triangles are counter-clockwise in (u, v). With `grid`, the quads carry the mechanics and the
/// triangles, two to a quad, serve contact and drawing.
struct Sheet {
  MaterialPoints material_m;
  Triangles triangles;
  std::optional<SheetGrid> grid;

  Eigen::Index vertex_count() const { return material_m.rows(); }
  /// A third of the area of the triangles around each vertex; of a grid, a quarter of the quads.
  Eigen::VectorXd vertex_areas_m2() const;
  /// As a mesh with these positions, (u, v) over the sheet's larger side as texture coordinates.
  Mesh mesh(const Points& positions_m) const;
};

/// Rectangle [0, warp] x [0, weft], with spacings as near `spacing_m` as whole quads allow. Throws
/// InvalidInput if a side is shorter than two spacings or there are more than 16 million vertices.
Sheet make_rectangle(double warp_m, double weft_m, double spacing_m);

/// Disc about (0, 0), in triangles along the yarns but for those at its rim and at the inner
/// circle, where edges run along the circle. Throws as make_rectangle does, for the diameter.
Sheet make_disc(double radius_m, double spacing_m, double inner_radius_m = 0.0);

/// A mesh whose uvs are metres in the fabric. Throws InvalidInput, naming `source`, for uvs that
/// are missing, triangles that are inverted or without area in the fabric, edges with more than two
/// triangles, and vertices without triangles.
Sheet make_sheet(const Mesh& mesh, const std::string& source);

/// What make_sheet and readers check.
void validate(const Sheet& sheet, const std::string& source);

}  // namespace semblance
