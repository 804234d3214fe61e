// Compiled with -mavx512f -mavx512vl -mavx512dq -mavx512bw (see CMakeLists.txt); called only where
// the processor has them.
#include "surface_kernel.h"

#if defined(__x86_64__)
#include <utility>

namespace semblance::detail {

namespace {
constexpr int lanes = 16;
#include "vectors.inc"
//
#include "surface_kernel.inc"
}  // namespace

const SurfaceKernel avx512_surface_kernel = surface_sums;

}  // namespace semblance::detail
#endif
