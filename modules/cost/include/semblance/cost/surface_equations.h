// Gauss-Newton normal equations of residuals that live on the image of a surface.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "semblance/core/mesh.h"
#include "semblance/cost/surface_parts.h"
#include "semblance/optim/objective.h"

namespace semblance {

/// Which vertices and edges the triangles of a scene have, numbered through.
struct SurfaceTopology {
  using Triangles = Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>;

  explicit SurfaceTopology(const Triangles& triangles);

  int vertex_count = 0;
  std::vector<std::array<int, 3>> triangles;
  std::vector<std::array<int, 3>> triangle_edges;  // opposite corner 0, 1, 2
  int edge_count = 0;
  std::vector<SurfaceSpoke> spokes;  // grouped by vertex
  std::vector<int> first_spoke;      // per vertex, and one more
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
  /// m = [m_xx m_xy; m_xy m_yy], positive semidefinite, and v = m times a displacement, per pixel^2
  /// and pixel.
  void add(int triangle, float b0, float b1, float b2, float m_xx, float m_xy, float m_yy,
           float v_x, float v_y);
  /// For code that adds many points: the sums of the given triangles (with repetition), and of
  /// those touched before, may be changed until the next call.
  SurfaceAccumulators accumulators(std::span<const std::int32_t> triangles);
  /// Vertices of triangles where the sum of m is not zero, ascending: the only ones whose motion
  /// matters.
  const std::vector<int>& touched_vertices();

  using Motion = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  /// Columns that a Motion should have for so many parameters: those past the last one hold zero.
  static Eigen::Index padded_columns(Eigen::Index parameters) {
    return (parameters + 15) / 16 * 16;
  }
  /// Adds H and g to `out`, whose size is the number of parameters. `motion` holds, for vertex
  /// k = touched_vertices()[i], rows 2 i and 2 i + 1: derivatives of its x and y pixel with respect
  /// to the parameters. Throws InvalidInput unless it has padded_columns() columns.
  void assemble(const Motion& motion, NormalEquations& out);

 private:
  void gather_blocks();
  std::span<const std::int32_t> touched_triangles() const {
    return {touched_triangles_.data(), touched_count_};
  }

  const SurfaceTopology* topology_;
  // Sums of touched triangles only, side by side: they then stay in the cache.
  struct alignas(32) Sums {  // none lies across two lines of the cache
    float values[SurfaceAccumulators::stride] = {};
  };
  std::vector<Sums> accumulators_;
  std::vector<std::int32_t> slot_of_triangle_;   // -1 where not touched
  std::vector<std::int32_t> touched_triangles_;  // by slot; the first touched_count_ count
  std::size_t touched_count_ = 0;
  std::vector<int> touched_vertices_;
  std::vector<int> slot_of_vertex_;  // index into touched_vertices_, -1 where untouched
  bool vertices_current_ = false;
  std::vector<float> edge_blocks_;  // 4 per edge: m, and what does not matter
  std::vector<float> own_;          // 4 per touched vertex: m, v_x
  std::vector<float> pull_y_;       // per touched vertex: v_y
  std::vector<float> scratch_, hessian_, gradient_;
};

}  // namespace semblance
