#include "surface_kernel.h"

namespace semblance::detail {

namespace {
#include "vectors.inc"
//
#include "surface_kernel.inc"
}  // namespace

const SurfaceKernel portable_surface_kernel = surface_sums;

SurfaceKernel surface_kernel() {
#if defined(__x86_64__)
  static const bool wide = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  if (wide) return avx2_surface_kernel;
#endif
  return portable_surface_kernel;
}

}  // namespace semblance::detail
