#include "photometric_kernel.h"

#include <utility>

#include "processor.h"

namespace semblance::detail {

namespace {
constexpr int lanes = 4;
#include "vectors.inc"
//
#include "photometric_kernel.inc"
}  // namespace

const Kernel portable_kernel = {shade, compare, linearize, light_vertices};

const Kernel& photometric_kernel() {
#if defined(__x86_64__)
  if (has_avx512()) return avx512_kernel;
  if (has_avx2()) return avx2_kernel;
#endif
  return portable_kernel;
}

}  // namespace semblance::detail
