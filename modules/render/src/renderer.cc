#include "semblance/render/renderer.h"

#include <array>

#include "frame.h"
#include "renderers.h"
#include "semblance/core/errors.h"

namespace semblance {
namespace {

struct Maker {
  const char* name;
  std::unique_ptr<Renderer> (*make)();
};

constexpr std::array<Maker, 3> makers{{
    {"raster", make_raster_renderer},
    {"osmesa", make_osmesa_renderer},
    {"embree", make_embree_renderer},
}};

}  // namespace

std::vector<std::string> renderer_names() {
  std::vector<std::string> names;
  for (const Maker& maker : makers) names.emplace_back(maker.name);
  return names;
}

std::unique_ptr<Renderer> make_renderer(const std::string& name) {
  std::string known;
  for (const Maker& maker : makers) {
    if (name == maker.name) return maker.make();
    known += (known.empty() ? "" : ", ") + std::string(maker.name);
  }
  throw InvalidInput("there is no renderer '" + name + "': expected one of " + known);
}

Frame empty_frame(const Scene& scene, const Camera& camera, Channel channels) {
  Frame frame;
  const int width = frame.width = camera.width, height = frame.height = camera.height;
  const std::size_t count = static_cast<std::size_t>(width) * height;
  if (has(channels, Channel::colour)) {
    frame.colour = Image(width, height, 3);
    for (std::size_t i = 0; i < count; ++i)
      for (int c = 0; c < 3; ++c) frame.colour.data[3 * i + c] = scene.background[c];
  }
  if (has(channels, Channel::depth)) frame.depth = Image(width, height, 1);
  if (has(channels, Channel::triangle)) frame.triangle.assign(count, -1);
  if (has(channels, Channel::barycentric)) frame.barycentric = Image(width, height, 3);
  if (has(channels, Channel::normal)) frame.normal = Image(width, height, 3);
  if (has(channels, Channel::mask)) frame.mask.assign(count, 0);
  return frame;
}

}  // namespace semblance
