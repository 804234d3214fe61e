// Compiled with -mavx2 (see CMakeLists.txt). Includes no standard header: an inline function
// compiled here could be linked in place of the baseline one and then run on a processor without.
#include "kernels.h"
#include "simd_avx2.h"

namespace semblance::avx2 {
namespace {
#include "kernels.inc"
}  // namespace

extern const Kernels kernels;
const Kernels kernels{project, rasterise, count_seen, list, interpolate, normalize, sample, light};

}  // namespace semblance::avx2
