// Renderers side by side. "frame" is a whole picture of 640 x 480 with 20,000 triangles; "face" is
// a textured, lit ellipsoid of 13,800 triangles that is 225 pixels across, so that it shows about
// 200 x 200 pixels.
#include <benchmark/benchmark.h>

#include "scenes.h"
#include "semblance/core/parallel.h"
#include "semblance/render/renderer.h"
#include "semblance/render/shading.h"
#include "semblance/render/visibility.h"

namespace semblance {
namespace {

struct View {
  Scene scene;
  Camera camera;
};

View make_view(int columns, int rows, double focal_px) {
  View view{{}, Camera::centred(640, 480, focal_px)};
  view.scene.objects.push_back(testing::make_ellipsoid(columns, rows, 0.6f));
  view.scene.objects[0].material.texture = testing::make_texture(512, 512);
  view.scene.light = testing::make_light();
  return view;
}
const View& face_view() {
  static const View view = make_view(92, 75, 600.0);
  return view;
}
const View& frame_view() {
  static const View view = make_view(125, 80, 1250.0);
  return view;
}

void report_pixels(benchmark::State& state, const View& view) {
  VisiblePixels pixels;
  Rasteriser().visible_pixels(view.scene, view.camera, nullptr, pixels);
  state.counters["pixels"] = static_cast<double>(pixels.size());
  state.counters["triangles"] = static_cast<double>(view.scene.objects[0].mesh->triangle_count());
}

void visibility(benchmark::State& state, const View& view) {
  Rasteriser rasteriser;
  VisiblePixels pixels;
  for (auto _ : state) {
    rasteriser.visible_pixels(view.scene, view.camera, nullptr, pixels);
    benchmark::DoNotOptimize(pixels.depth_m.data());
  }
  if (state.thread_index() == 0) report_pixels(state, view);
}

/// Visible pixels, their normals and texture coordinates, texture and light: what a cost compares.
void shaded_lists(benchmark::State& state, const View& view) {
  const SceneObject& object = view.scene.objects[0];
  VertexRows normals = VertexRows::Zero(object.normals.rows(), 4), uvs = normals;
  normals.leftCols<3>() = object.normals;
  uvs.leftCols<2>() = object.mesh->uvs;
  Rasteriser rasteriser;
  VisiblePixels pixels;
  std::array<PixelList, 3> normal, rgb;
  std::array<PixelList, 2> uv;
  for (auto _ : state) {
    rasteriser.visible_pixels(view.scene, view.camera, nullptr, pixels);
    interpolate(pixels, *object.mesh, 0, normals, normal);
    normalize(normal[0], normal[1], normal[2]);
    interpolate(pixels, *object.mesh, 0, uvs, uv);
    sample_texture(*object.material.texture, uv[0], uv[1], rgb);
    apply_light(view.scene.light, normal, rgb);
    benchmark::DoNotOptimize(rgb[0].data());
  }
}

void draw(benchmark::State& state, const View& view, const char* name, Channel channels) {
  const std::unique_ptr<Renderer> renderer = make_renderer(name);
  set_thread_count(1);
  for (auto _ : state) {
    const Frame frame = renderer->render(view.scene, view.camera, channels);
    benchmark::DoNotOptimize(frame.colour.data.data());
  }
  set_thread_count(0);
}

BENCHMARK_CAPTURE(visibility, face, face_view())
    ->Name("render/visibility/face")
    ->ThreadRange(1, 2)
    ->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(visibility, frame, frame_view())
    ->Name("render/visibility/frame")
    ->ThreadRange(1, 2)
    ->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(shaded_lists, face, face_view())
    ->Name("render/shaded_lists/face")
    ->ThreadRange(1, 2)
    ->Unit(benchmark::kMicrosecond);

/// One renderer, both views: the picture alone, and with triangle ids and normals.
void add_renderer(const char* name) {
  const Channel wide = Channel::colour | Channel::triangle | Channel::normal;
  for (const auto& [what, view] :
       {std::pair<const char*, const View*>{"face", &face_view()}, {"frame", &frame_view()}}) {
    for (const auto& [suffix, channels] :
         {std::pair<const char*, Channel>{"", Channel::colour}, {"_with_ids_and_normals", wide}}) {
      const std::string title = std::string("render/") + name + "/" + what + suffix;
      benchmark::RegisterBenchmark(title.c_str(), draw, *view, name, channels)
          ->Threads(1)
          ->Unit(benchmark::kMicrosecond);
    }
  }
}

const bool renderers_added = [] {
  for (const char* name : {"raster", "osmesa", "embree"}) add_renderer(name);
  return true;
}();

}  // namespace
}  // namespace semblance
