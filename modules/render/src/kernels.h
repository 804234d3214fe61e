// The wide loops behind rasteriser and shading, in three builds of the same source (kernels.inc):
// for any processor, for those with AVX2, and for those with AVX-512. Plain pointers only, so that
// no inline function of another library is compiled for one and then linked in its place elsewhere.
#pragma once

#include <stdint.h>

namespace semblance {

/// The widest vector of any build: what says "room for a multiple of lanes" has room for a multiple
/// of this.
constexpr int most_lanes = 16;

/// Screen coordinates are integers of 1/1024 pixel, counted from the first pixel's centre.
constexpr int subpixel_bits = 10;
constexpr int subpixel_one = 1 << subpixel_bits;
/// Triangles no wider and higher than this are set up side by side with 32-bit edge functions.
constexpr int small_extent = 31 * subpixel_one;

/// A vertex on the screen. inverse_z is 0 where it cannot be projected.
struct alignas(16) ScreenVertex {
  int32_t x, y;
  float inverse_z;
  float unused;
};

/// A triangle's barycentrics times 1/z as linear functions of the pixel: b1 = (b1_x dx + b1_y dy) z
/// with dx, dy measured in pixels from (x0, y0), the pixel-centred position of corner 0.
struct alignas(32) TrianglePlanes {
  float b1_x, b1_y, b2_x, b2_y, x0, y0, unused[2];
};

struct ProjectArgs {
  const float* positions;  // rows of 3, world frame
  int64_t count;
  float rotation[9], translation[3];  // camera from world, row-major
  float focal_x, focal_y, principal_x, principal_y;
  ScreenVertex* vertices;              // room for a multiple of lanes
  float* projected;                    // rows of 3, room for a multiple of lanes and one float more
  int32_t min_x, min_y, max_x, max_y;  // in and out: bounds of the vertices that project
};

/// What the nearest surface at a pixel is, in one word of which the largest wins: 1/z in the high
/// half, the complement of the triangle's number in the low half. 0 where nothing is seen.
using PixelKey = uint64_t;

struct RasteriseArgs {
  const int32_t* triangles;  // rows of 3
  int64_t count;
  const ScreenVertex* vertices;
  TrianglePlanes* planes;  // of the object's first triangle; room for a multiple of lanes
  int32_t first_id;
  int32_t x0, y0, x1, y1;  // pixels drawn
  // Leave out triangles whose area is positive: rows count downwards, so they are seen from behind.
  bool front_only;
  PixelKey* keys;       // of pixel (x0, y0)
  int32_t stride;       // of the rows of `keys`, a multiple of lanes
  int32_t* large;       // out: rows of `triangles` too large for this kernel, room for `count`
  int64_t large_count;  // out
};

struct ListArgs {
  PixelKey* keys;  // read and set back to 0
  int32_t stride, height, x0, y0, image_width;
  const TrianglePlanes* planes;
  // Out, one entry per key that is not 0.
  int32_t *pixel, *triangle;
  float *b1, *b2, *depth;
  // Scratch, room for stride + 2 lanes each.
  int32_t* pending_triangle;
  float *pending_inverse_z, *pending_x, *pending_y;
};

struct InterpolateArgs {
  int64_t count;
  const int32_t* triangle;
  const float *b1, *b2;
  const int32_t* corners;  // rows of 3, of triangle number first_triangle on
  int32_t first_triangle;
  const float* rows;  // rows of 4, one per vertex
  float* out[4];      // may be null
};

struct SampleArgs {
  int64_t count;
  const float *u, *v;
  const float* texels;  // rows of 3
  int32_t width, height;
  float* rgb[3];
};

struct LightArgs {
  int64_t count;
  const float* normal[3];
  float coefficients[9][3];
  float* rgb[3];  // multiplied
};

struct Kernels {
  void (*project)(ProjectArgs& args);
  void (*rasterise)(RasteriseArgs& args);
  /// How many of `count` keys (a multiple of lanes) are not 0.
  int64_t (*count_seen)(const PixelKey* keys, int64_t count);
  void (*list)(const ListArgs& args);
  void (*interpolate)(const InterpolateArgs& args);
  void (*normalize)(int64_t count, float* x, float* y, float* z);
  void (*sample)(const SampleArgs& args);
  void (*light)(const LightArgs& args);
};

const Kernels& portable_kernels();
/// Those for AVX2, or the portable ones where the processor lacks it.
const Kernels& avx2_kernels();
/// The fastest that the processor can run.
const Kernels& best_kernels();

}  // namespace semblance
