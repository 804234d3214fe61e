// The dense sums of the surface equations, without Eigen so that they can be compiled for several
// machines.
#pragma once

#include <cstddef>
#include <cstdint>

#include "semblance/cost/surface_parts.h"

namespace semblance::detail {

/// `slots` numbers the vertices that matter, in the order of the rows of `motion`.
struct SurfaceSums {
  std::size_t count;    // slots
  std::size_t stride;   // floats in a row of motion, a multiple of 16
  const float* motion;  // rows 2 i and 2 i + 1 of slot i
  const int* vertex_of_slot;
  const int* slot_of_vertex;   // -1 where it has none
  const SurfaceSpoke* spokes;  // of vertex v: first_spoke[v] up to first_spoke[v + 1]
  const int* first_spoke;
  const float* own;     // 4 per slot: A_ii (xx, xy, yy), v_x
  const float* pull_y;  // per slot: v_y
  const float* edges;   // 4 per edge: A_ij (xx, xy, yy) of its ends, unused
};

/// Adds sum_(i, j) d_i' A_ij d_j to the lower triangle of `hessian` (stride x stride; what it
/// writes above the diagonal is not complete) and sum_i d_i' v_i to `gradient`, where d_i is the
/// pair of rows of slot i. `scratch` has room for surface_scratch_rows rows.
using SurfaceKernel = void (*)(const SurfaceSums& in, float* scratch, float* hessian,
                               float* gradient);
/// Few enough rows of motion and of their products to stay in the first cache together.
constexpr std::size_t surface_scratch_rows = 64;

/// The fastest kernel this machine can run.
SurfaceKernel surface_kernel();
/// For tests: the one that runs everywhere.
extern const SurfaceKernel portable_surface_kernel;
#if defined(__x86_64__)
extern const SurfaceKernel avx2_surface_kernel;
extern const SurfaceKernel avx512_surface_kernel;
#endif

}  // namespace semblance::detail
