// Compiled with -mavx2. Includes no standard header: an inline function compiled here could be
// linked in place of the baseline one and then run on a processor without AVX2.
#include "kernels.h"
#include "simd_avx2.h"

namespace semblance {
namespace avx2 {
namespace {
#include "kernels.inc"
}  // namespace
}  // namespace avx2

const Kernels& avx2_kernels();
const Kernels& avx2_kernels() {
  static constexpr Kernels kernels{avx2::project, avx2::rasterise,   avx2::count_seen,
                                   avx2::list,    avx2::interpolate, avx2::normalize,
                                   avx2::sample,  avx2::light};
  return kernels;
}

}  // namespace semblance
