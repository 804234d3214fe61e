// Compiled with -mavx2 -mfma (see CMakeLists.txt); called only where the processor has both.
#include "surface_kernel.h"

#if defined(__x86_64__)
namespace semblance::detail {

namespace {
#include "vectors.inc"
//
#include "surface_kernel.inc"
}  // namespace

const SurfaceKernel avx2_surface_kernel = surface_sums;

}  // namespace semblance::detail
#endif
