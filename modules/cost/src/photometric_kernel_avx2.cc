// Compiled with -mavx2 -mfma (see CMakeLists.txt); called only where the processor has both.
#include "photometric_kernel.h"

#if defined(__x86_64__)
#include <utility>

namespace semblance::detail {

namespace {
constexpr int lanes = 8;
#include "vectors.inc"
//
#include "photometric_kernel.inc"
}  // namespace

const Kernel avx2_kernel = {shade, compare, linearize, light_vertices};

}  // namespace semblance::detail
#endif
