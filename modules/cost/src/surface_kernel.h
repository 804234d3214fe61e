// The dense part of SurfaceEquations, without Eigen so that it can be compiled for several
// machines.
#pragma once

#include <cstddef>
#include <cstdint>

#include "semblance/cost/surface_coupling.h"

namespace semblance::detail {

struct SurfaceSums {
  std::size_t count;               // vertices
  std::size_t stride;              // floats in a row of motion, a multiple of 8
  const float* motion;             // rows 2 i and 2 i + 1 of vertex i
  const SurfaceCoupling* coupled;  // of vertex i: first_coupled[i] up to first_coupled[i + 1]
  const std::int32_t* first_coupled;
  const float* pull;  // (v_x, v_y) per vertex
};

/// Adds sum_(i, j coupled) d_i' A_ij d_j to the lower triangle of `hessian` (stride x stride; what
/// it writes above the diagonal is not complete) and sum_i d_i' v_i to `gradient`, where d_i is the
/// pair of rows of vertex i. `scratch` has room for surface_scratch_rows rows.
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
#endif

}  // namespace semblance::detail
