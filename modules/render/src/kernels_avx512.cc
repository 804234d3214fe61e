// Compiled with -mavx512f and others (see CMakeLists.txt). Includes no standard header: an inline
// function compiled here could be linked in place of the baseline one and then run on a processor
// without.
#include "kernels.h"
#include "simd_avx512.h"

namespace semblance::avx512 {
namespace {
#include "kernels.inc"
}  // namespace

extern const Kernels kernels;
const Kernels kernels{project, rasterise, count_seen, list, interpolate, normalize, sample, light};

}  // namespace semblance::avx512
