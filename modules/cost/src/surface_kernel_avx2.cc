// Compiled with -mavx2 -mfma (see CMakeLists.txt); called only where the processor has both.
#include "surface_kernel.h"

#if defined(__x86_64__)
#include <utility>

namespace semblance::detail {

namespace {
constexpr int lanes = 8;
#include "vectors.inc"
//
#include "surface_kernel.inc"
}  // namespace

const SurfaceKernel avx2_surface_kernel = surface_sums;

}  // namespace semblance::detail
#endif
