#include "surface_kernel.h"

#include <utility>

#include "processor.h"

namespace semblance::detail {

namespace {
constexpr int lanes = 4;
#include "vectors.inc"
//
#include "surface_kernel.inc"
}  // namespace

const SurfaceKernel portable_surface_kernel = surface_sums;

SurfaceKernel surface_kernel() {
#if defined(__x86_64__)
  if (has_avx512()) return avx512_surface_kernel;
  if (has_avx2()) return avx2_surface_kernel;
#endif
  return portable_surface_kernel;
}

}  // namespace semblance::detail
