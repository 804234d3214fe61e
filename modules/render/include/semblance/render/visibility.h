// The inner loop's view of a scene: which surface point each pixel sees, as compact lists.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "semblance/core/camera.h"
#include "semblance/core/mesh.h"
#include "semblance/core/scene.h"

namespace semblance {

/// The pixels that see a surface, in rows from the top: entry i of every list belongs to the same
/// pixel. b0 = 1 - b1 - b2; all three are perspective-correct.
struct VisiblePixels {
  std::vector<std::int32_t> pixel;     // y * width + x
  std::vector<std::int32_t> triangle;  // numbered through the scene
  std::vector<float> b1, b2;
  std::vector<float> depth_m;

  std::size_t size() const { return pixel.size(); }
};

/// Pixel rectangle [x0, x1) x [y0, y1).
struct PixelRect {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
};

/// Our visibility-buffer rasteriser. Keeps its buffers between calls, so one per thread.
class Rasteriser {
 public:
  /// All kinds of instructions give the same bits; others than `best` exist to test that. `avx2` is
  /// portable where the processor lacks it.
  enum class Instructions { best, avx2, portable };
  /// `front` leaves out triangles seen from behind, which a closed surface hides anyway.
  enum class Faces { all, front };
  explicit Rasteriser(Instructions instructions = Instructions::best, Faces faces = Faces::all);
  ~Rasteriser();
  Rasteriser(Rasteriser&&) noexcept;
  Rasteriser& operator=(Rasteriser&&) noexcept;

  /// Fills `out` with the pixels whose centre sees a surface of the scene, nearest first where
  /// surfaces overlap (the lower triangle number wins a tie), clipped to `region` (the whole image
  /// when null). Triangles that reach behind the near plane (1 mm), or more than a million pixels
  /// away, are left out. Every pixel centre on an edge belongs to one of the triangles that share
  /// it (vertices are rounded to 1/1024 pixel, edges are exact). Throws InvalidInput for a
  /// distorted camera and for objects whose positions do not fit their mesh.
  void visible_pixels(const Scene& scene, const Camera& camera, const PixelRect* region,
                      VisiblePixels& out);
  /// The last call's projected vertices: (x_px, y_px, depth_m) per vertex, numbered through the
  /// scene's objects; not finite for vertices left out.
  std::span<const float> projected_vertices() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace semblance
