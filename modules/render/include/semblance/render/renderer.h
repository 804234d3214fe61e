// One interface for every renderer, and the table of those there are.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "semblance/core/camera.h"
#include "semblance/core/image.h"
#include "semblance/core/scene.h"

namespace semblance {

/// Which images of a Frame are wanted; combine with |.
enum class Channel : unsigned {
  colour = 1,
  depth = 2,
  triangle = 4,
  barycentric = 8,
  normal = 16,
  mask = 32,
  all = 63
};
constexpr Channel operator|(Channel a, Channel b) {
  return static_cast<Channel>(static_cast<unsigned>(a) | static_cast<unsigned>(b));
}
constexpr bool has(Channel set, Channel one) {
  return (static_cast<unsigned>(set) & static_cast<unsigned>(one)) != 0;
}

/// A rendered picture. Images that were not asked for are empty.
struct Frame {
  int width = 0, height = 0;
  Image colour;                        // 3 channels, linear RGB
  Image depth;                         // z in the camera frame in metres, 0 where nothing is seen
  std::vector<std::int32_t> triangle;  // numbered through the scene, -1 where nothing is seen
  Image barycentric;                   // 3 channels, perspective-correct, of the triangle's corners
  Image normal;                        // 3 channels, world frame, interpolated, unit
  std::vector<std::uint8_t> mask;      // 1 where something is seen
};

/// Draws a scene through a pinhole camera (distortion is an error: draw undistorted, then warp).
/// A pixel shows what its centre sees. Back faces are drawn like front faces.
class Renderer {
 public:
  virtual ~Renderer() = default;
  virtual std::string name() const = 0;
  virtual Frame render(const Scene& scene, const Camera& camera, Channel channels) = 0;
  /// An independent renderer of the same kind for another thread.
  virtual std::unique_ptr<Renderer> clone() const = 0;
};

/// "raster", "osmesa", "embree".
std::vector<std::string> renderer_names();
/// Throws InvalidInput listing the names if there is no such renderer. To add one: implement
/// Renderer in a file of its own and add a line to the table in renderer.cc.
std::unique_ptr<Renderer> make_renderer(const std::string& name);

}  // namespace semblance
