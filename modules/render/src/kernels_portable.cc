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

#ifdef SEMBLANCE_RENDER_X86
namespace avx2 {
extern const Kernels kernels;
}
namespace avx512 {
extern const Kernels kernels;
}

namespace {

bool has_avx2() {
  static const bool has = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi") &&
                          __builtin_cpu_supports("bmi2") && __builtin_cpu_supports("popcnt");
  return has;
}

bool has_avx512() {
  static const bool has = has_avx2() && __builtin_cpu_supports("avx512f") &&
                          __builtin_cpu_supports("avx512vl") &&
                          __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw");
  return has;
}

}  // namespace

const Kernels& avx2_kernels() { return has_avx2() ? avx2::kernels : portable_kernels(); }
const Kernels& best_kernels() { return has_avx512() ? avx512::kernels : avx2_kernels(); }
#else
const Kernels& avx2_kernels() { return portable_kernels(); }
const Kernels& best_kernels() { return portable_kernels(); }
#endif

}  // namespace semblance
