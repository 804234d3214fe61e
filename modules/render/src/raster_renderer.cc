// The rasteriser behind the Renderer interface: visible pixels, then shading object by object.
#include <algorithm>

#include "frame.h"
#include "renderers.h"
#include "scene_check.h"
#include "semblance/render/shading.h"
#include "semblance/render/visibility.h"

namespace semblance {
namespace {

/// The entries of `all` from triangles [first, last), when those of other objects lie between.
void select_object(const VisiblePixels& all, int first, int last, VisiblePixels& out) {
  out.pixel.clear(), out.triangle.clear(), out.b1.clear(), out.b2.clear(), out.depth_m.clear();
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (all.triangle[i] < first || all.triangle[i] >= last) continue;
    out.pixel.push_back(all.pixel[i]);
    out.triangle.push_back(all.triangle[i]);
    out.b1.push_back(all.b1[i]);
    out.b2.push_back(all.b2[i]);
    out.depth_m.push_back(all.depth_m[i]);
  }
}

void scatter(const VisiblePixels& pixels, std::span<const PixelList> lists, Image& image) {
  for (std::size_t i = 0; i < pixels.size(); ++i)
    for (int c = 0; c < 3; ++c) image.data[3 * std::size_t(pixels.pixel[i]) + c] = lists[c][i];
}

class RasterRenderer : public Renderer {
 public:
  std::string name() const override { return "raster"; }
  std::unique_ptr<Renderer> clone() const override { return std::make_unique<RasterRenderer>(); }
  Frame render(const Scene& scene, const Camera& camera, Channel channels) override;

 private:
  void shade(const Scene& scene, const SceneObject& object, int first_triangle,
             const VisiblePixels& pixels, Channel channels, Frame& frame);

  Rasteriser rasteriser_;
  VisiblePixels visible_, of_object_;
  VertexRows rows_;
  std::array<PixelList, 3> normal_, rgb_;
  std::array<PixelList, 2> uv_;
};

/// Everything that needs no shading.
void copy_geometry(const VisiblePixels& pixels, Frame& frame) {
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const std::size_t at = pixels.pixel[i];
    if (!frame.depth.empty()) frame.depth.data[at] = pixels.depth_m[i];
    if (!frame.triangle.empty()) frame.triangle[at] = pixels.triangle[i];
    if (!frame.mask.empty()) frame.mask[at] = 1;
    if (!frame.barycentric.empty()) {
      float* b = frame.barycentric.data.data() + 3 * at;
      b[0] = 1.0f - pixels.b1[i] - pixels.b2[i], b[1] = pixels.b1[i], b[2] = pixels.b2[i];
    }
  }
}

void RasterRenderer::shade(const Scene& scene, const SceneObject& object, int first_triangle,
                           const VisiblePixels& pixels, Channel channels, Frame& frame) {
  rows_.setZero(object.normals.rows(), 4);
  rows_.leftCols<3>() = object.normals;
  interpolate(pixels, *object.mesh, first_triangle, rows_, normal_);
  normalize(normal_[0], normal_[1], normal_[2]);
  if (has(channels, Channel::normal)) scatter(pixels, normal_, frame.normal);
  if (!has(channels, Channel::colour)) return;
  if (object.material.texture != nullptr) {
    rows_.leftCols<2>() = object.mesh->uvs;
    interpolate(pixels, *object.mesh, first_triangle, rows_, uv_);
    sample_texture(*object.material.texture, uv_[0], uv_[1], rgb_);
  } else {
    for (int c = 0; c < 3; ++c) rgb_[c].assign(pixels.size(), object.material.colour[c]);
  }
  apply_light(scene.light, normal_, rgb_);
  scatter(pixels, rgb_, frame.colour);
}

Frame RasterRenderer::render(const Scene& scene, const Camera& camera, Channel channels) {
  check_renderable(scene, camera);
  check_shadable(scene, channels);
  rasteriser_.visible_pixels(scene, camera, nullptr, visible_);
  Frame frame = empty_frame(scene, camera, channels);
  copy_geometry(visible_, frame);
  if (!has(channels, Channel::colour) && !has(channels, Channel::normal)) return frame;
  int first = 0;
  for (const SceneObject& object : scene.objects) {
    const int last = first + static_cast<int>(object.mesh->triangle_count());
    const bool alone = scene.objects.size() == 1;
    if (!alone) select_object(visible_, first, last, of_object_);
    shade(scene, object, first, alone ? visible_ : of_object_, channels, frame);
    first = last;
  }
  return frame;
}

}  // namespace

std::unique_ptr<Renderer> make_raster_renderer() { return std::make_unique<RasterRenderer>(); }

}  // namespace semblance
