// Gauss-Newton normal equations of residuals that live on the image of a surface.
#pragma once

#include <array>
#include <vector>

#include "semblance/core/mesh.h"
#include "semblance/optim/objective.h"

namespace semblance {

/// Which vertices and edges the triangles of a scene have, numbered through.
struct SurfaceTopology {
  using Triangles = Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>;

  explicit SurfaceTopology(const Triangles& triangles);

  int vertex_count = 0;
  std::vector<std::array<int, 3>> triangles;
  std::vector<std::array<int, 3>> triangle_edges;  // opposite corner 0, 1, 2
  std::vector<std::array<int, 2>> edges;
};

/// Sums J'WJ and J'Wr of residuals whose value depends on where a surface point appears in the
/// image, without ever forming J. A point with barycentrics b in triangle t moves in the image by
/// sum_i b_i d_i, where d_i = (derivative of corner i's pixel with respect to the parameters), so
/// its share m of the 2x2 matrix and v of the gradient reaches only pairs of corners of t:
///   H = sum_points (sum_i b_i d_i)' m (sum_j b_j d_j) = sum_(i,j) d_i' A_ij d_j,
/// with one 2x2 block A per vertex and per edge. Adding a point costs 24 multiply-adds whatever the
/// number of parameters; `assemble` then is a sparse product and one dense product over vertices.
class SurfaceEquations {
 public:
  explicit SurfaceEquations(const SurfaceTopology* topology);

  void reset();
  /// m = [m_xx m_xy; m_xy m_yy] and v per pixel^2 and pixel.
  void add(int triangle, float b0, float b1, float b2, float m_xx, float m_xy, float m_yy,
           float v_x, float v_y);
  /// 24 sums per triangle, for code that adds many points: for the corner pairs 00, 11, 22, 12, 20,
  /// 01 the sums of b_i b_j (m_xx, m_xy, m_yy), then for each corner those of b_i (v_x, v_y).
  float* accumulators();
  /// Vertices that any added point touches, ascending: the only ones whose motion matters.
  const std::vector<int>& touched_vertices();

  /// Adds scale * H and scale * g to `out`. `motion` holds, for vertex k = touched_vertices()[i],
  /// rows 2 i and 2 i + 1: derivatives of its x and y pixel with respect to the parameters.
  using Motion = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  void assemble(const Motion& motion, double scale, NormalEquations& out);

 private:
  static constexpr int kStride = 24;  // 6 corner pairs x 3 entries of m, 3 corners x 2 of v

  const SurfaceTopology* topology_;
  std::vector<float> accumulators_;  // kStride per triangle
  std::vector<int> touched_triangles_, touched_edges_, touched_vertices_;
  std::vector<int> slot_of_vertex_;  // index into touched_vertices_, -1 where untouched
  bool vertices_current_ = false;
  std::vector<float> vertex_blocks_, edge_blocks_;
  Motion product_;
};

}  // namespace semblance
