// Plain parts of surfaces and their equations, for code compiled without Eigen.
#pragma once

#include <cstddef>
#include <cstdint>

namespace semblance {

/// An edge seen from one of its ends: its number, and the vertex at the other end.
struct SurfaceSpoke {
  int edge = 0, other = 0;
};

/// Sums over the points of each triangle, 24 per triangle. With m the 2x2 matrix and v the gradient
/// of a point (see SurfaceEquations) and b its barycentrics, floats 8 k to 8 k + 2 are the sums of
/// b_k^2 (m_xx, m_xy, m_yy), 8 k + 3 of b_k v_x, 8 k + 4 to 8 k + 6 of b_i b_j (m_xx, m_xy, m_yy)
/// for the other corners i and j, and 8 k + 7 of b_k v_y.
struct SurfaceAccumulators {
  static constexpr std::ptrdiff_t stride = 24;
  float* sums = nullptr;
  const std::int32_t* slot_of_triangle = nullptr;

  float* of(std::int32_t triangle) const { return sums + stride * slot_of_triangle[triangle]; }
};

}  // namespace semblance
