// Ray tracing of a lit head for synthesis: shadows, ambient occlusion, highlights.
#pragma once

#include <memory>
#include <vector>

#include "semblance/core/camera.h"
#include "semblance/core/image.h"
#include "semblance/core/scene.h"

namespace semblance {

/// How the surface of one object answers light beyond its albedo.
struct Surface {
  float gloss = 0.03f;         // strength of the highlight seen head-on
  float shininess = 20.0f;     // exponent of the highlight (Blinn 1977)
  float wrap = 0.0f;           // light that bleeds past the terminator, as through skin
  std::vector<float> ambient;  // per vertex, share of the sky that reaches it; empty: all
};

/// Sky light as spherical harmonics and one distant lamp that casts shadows.
struct Lighting {
  ShLight sky;
  Eigen::Vector3f lamp_direction = Eigen::Vector3f::UnitZ();  // unit, from the scene to the lamp
  Eigen::Vector3f lamp_colour = Eigen::Vector3f::Zero();      // linear RGB on a surface facing it
};

/// Premultiplied linear RGB and coverage (4 channels), and the depth of the nearest sample per
/// pixel (1 channel, z in metres, 0 where nothing is seen).
struct Traced {
  Image rgba;
  Image depth;
};

/// Traces one scene at a time on the calling thread. One per thread.
class Tracer {
 public:
  Tracer();
  ~Tracer();
  Tracer(Tracer&&) noexcept;

  /// Copies positions and triangles; the scene's objects must outlive the calls of `trace`.
  void set_scene(const Scene& scene, const std::vector<Surface>& surfaces);
  /// `samples` rays per pixel (a square number) on a regular grid.
  Traced trace(const Camera& camera, const Lighting& lighting, int samples) const;
  /// Per vertex of object `object`: the cosine-weighted share of `rays` directions above the
  /// surface that leave the scene within `reach_m`.
  std::vector<float> ambient_occlusion(int object, int rays, float reach_m) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace semblance
