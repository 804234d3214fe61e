// The passes over visible pixels, without Eigen so that they can be compiled for several machines.
#pragma once

#include <cstddef>
#include <cstdint>

namespace semblance::detail {

/// Per vertex: texel coordinates (column, row; texel centres at +0.5), encoded light, padding.
struct VertexRecord {
  float column, row, pad0, pad1;
  float red, green, blue, one;
};

struct ShadeInput {
  std::size_t count;
  const std::int32_t* triangle;
  const float* b1;
  const float* b2;
  const std::int32_t* corners;  // 3 per triangle
  const VertexRecord* vertices;
  const float* texels;  // 4 floats each, rows from the top
  int texture_width, texture_height;
};

struct CompareInput {
  std::size_t count;
  const std::int32_t* pixel;
  const std::int32_t* triangle;
  const float* b1;
  const float* b2;
  const float* colour;   // 4 per pixel, from shade
  const float* records;  // 12 per image pixel (ObservationLevel)
  const float* triangle_weight;
  float inverse_variance;  // 1 / sigma^2
  float inverse_width;     // 1 / (robust_width^2), of residuals in sigma
};

struct CompareSums {
  double cost = 0.0;    // sum of weight * rho / 2
  double weight = 0.0;  // sum of weight
};

struct Kernel {
  /// colour[4 i ..]: encoded rgb and confidence of visible pixel i.
  void (*shade)(const ShadeInput& input, float* colour);
  /// Sums only.
  CompareSums (*compare)(const CompareInput& input);
  /// Sums, and adds every pixel's 24 numbers to its triangle's accumulator (24 floats each, order
  /// of SurfaceEquations).
  CompareSums (*linearize)(const CompareInput& input, float* accumulators);
};

/// The fastest kernel this machine can run.
const Kernel& photometric_kernel();
/// For tests: the one that runs everywhere.
extern const Kernel portable_kernel;
#if defined(__x86_64__)
extern const Kernel avx2_kernel;
#endif

}  // namespace semblance::detail
