// The passes over visible pixels, without Eigen so that they can be compiled for several machines.
#pragma once

#include <cstddef>
#include <cstdint>

#include "semblance/cost/surface_parts.h"

namespace semblance::detail {

/// Per vertex: texel coordinates (column, row; texel centres at integers), encoded light, padding.
/// Aligned, so that none lies across two lines of the cache.
struct alignas(32) VertexRecord {
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
  const float* triangle_weight;
  const float* texels;                // 4 floats each, rows from the top
  int texture_width, texture_height;  // at least 2
};

struct CompareInput {
  const std::int32_t* pixel;  // as many as are shaded, ascending
  const float* observed;      // 4 per image pixel (ObservationLevel): encoded rgb, 0
  const float* gradient;      // 8 per image pixel
  float inverse_variance;     // 1 / sigma^2
  float inverse_width;        // 1 / (robust_width^2), of residuals in sigma
};

struct CompareSums {
  double cost = 0.0;    // sum of weight * rho / 2
  double weight = 0.0;  // sum of weight
};

struct LightInput {
  std::size_t count;           // vertices
  const float *normals, *uvs;  // 3 and 2 per vertex
  float coefficients[9][3];    // of ShLight
  int texture_width, texture_height;
};

struct Kernel {
  /// colour[4 i ..]: encoded rgb and weight (confidence * triangle weight) of visible pixel i.
  /// Returns the sum of weights.
  double (*shade)(const ShadeInput& input, float* colour);
  /// Sums only, shading on the way.
  CompareSums (*compare)(const ShadeInput& shading, const CompareInput& input);
  /// Sum of cost, and adds scale times every pixel's 24 numbers to its triangle's sums. `colour`
  /// comes from `shade`.
  double (*linearize)(const ShadeInput& shading, const CompareInput& input, const float* colour,
                      float scale, const SurfaceAccumulators& out);
  /// The vertices' texel coordinates and encoded light.
  void (*light_vertices)(const LightInput& input, VertexRecord* out);
};

/// The fastest kernel this machine can run.
const Kernel& photometric_kernel();
/// For tests: the one that runs everywhere.
extern const Kernel portable_kernel;
#if defined(__x86_64__)
extern const Kernel avx2_kernel;
extern const Kernel avx512_kernel;
#endif

}  // namespace semblance::detail
