// Positions of cloth, as every part of the module holds them.
#pragma once

#include <Eigen/Core>

namespace semblance {

/// Rows are vertices; the type of Mesh::positions_m.
using Points = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
/// Rows are the corners of triangles; the type of Mesh::triangles.
using Triangles = Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>;

}  // namespace semblance
