// Compiled with -mavx512f -mavx512vl -mavx512dq -mavx512bw (see CMakeLists.txt); called only where
// the processor has them.
#include "photometric_kernel.h"

#if defined(__x86_64__)
#include <utility>

namespace semblance::detail {

namespace {
constexpr int lanes = 16;
#include "vectors.inc"
//
#include "photometric_kernel.inc"
}  // namespace

const Kernel avx512_kernel = {shade, compare, linearize, light_vertices};

}  // namespace semblance::detail
#endif
