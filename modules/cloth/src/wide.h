// Vectors for the innermost loops, and functions compiled for several processors.
#pragma once

#include <cstddef>

// A function marked so exists for newer instruction sets too; the loader takes the best one.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define SEMBLANCE_WIDE __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define SEMBLANCE_WIDE
#endif

namespace semblance {

using Float4 = float __attribute__((vector_size(16)));
using Double4 = double __attribute__((vector_size(32)));

[[gnu::always_inline]] inline Double4 load4(const float* p) {
  Float4 v;
  __builtin_memcpy(&v, p, sizeof(v));
  return __builtin_convertvector(v, Double4);
}

[[gnu::always_inline]] inline Double4 load4(const double* p) {
  Double4 v;
  __builtin_memcpy(&v, p, sizeof(v));
  return v;
}

}  // namespace semblance
