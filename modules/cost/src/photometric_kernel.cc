#include "photometric_kernel.h"

namespace semblance::detail {

namespace {
#include "vectors.inc"
//
#include "photometric_kernel.inc"
}  // namespace

const Kernel portable_kernel = {shade, compare, linearize};

const Kernel& photometric_kernel() {
#if defined(__x86_64__)
  static const bool wide = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  if (wide) return avx2_kernel;
#endif
  return portable_kernel;
}

}  // namespace semblance::detail
