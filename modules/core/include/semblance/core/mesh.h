// Triangle meshes as plain matrices.
#pragma once

#include <Eigen/Core>
#include <string>

namespace semblance {

/// Indexed triangle mesh. Rows of `positions_m` are vertices; a triangle is counter-clockwise seen
/// from outside. `uvs` is empty or has a row per vertex: vertices on a texture seam are doubled.
struct Mesh {
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> positions_m;
  Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor> triangles;
  Eigen::Matrix<float, Eigen::Dynamic, 2, Eigen::RowMajor> uvs;

  Eigen::Index vertex_count() const { return positions_m.rows(); }
  Eigen::Index triangle_count() const { return triangles.rows(); }
};

/// Throws InvalidInput, naming `source`, if a position is not finite, an index is out of range, a
/// triangle uses a vertex twice, or uvs are present in the wrong number.
void validate(const Mesh& mesh, const std::string& source);

/// Rows of floats, as renderers take them.
using PointsF = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// Unit vertex normals, weighted by triangle area; zero where a vertex has no area around it.
/// `normals` is resized to the number of positions.
void vertex_normals(const PointsF& positions_m,
                    const Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>& triangles,
                    PointsF& normals);

}  // namespace semblance
