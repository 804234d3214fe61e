#include "kernels.h"
#include "simd_portable.h"

namespace semblance {
namespace portable {
namespace {
#include "kernels.inc"
}  // namespace
}  // namespace portable

const Kernels& portable_kernels() {
  static const Kernels kernels{portable::project, portable::rasterise,   portable::count_seen,
                               portable::list,    portable::interpolate, portable::normalize,
                               portable::sample,  portable::light};
  return kernels;
}

#ifdef SEMBLANCE_RENDER_AVX2
const Kernels& avx2_kernels();

const Kernels& best_kernels() {
  static const bool has_avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi") &&
                               __builtin_cpu_supports("bmi2") && __builtin_cpu_supports("popcnt");
  return has_avx2 ? avx2_kernels() : portable_kernels();
}
#else
const Kernels& best_kernels() { return portable_kernels(); }
#endif

}  // namespace semblance
