// Ray-traced pictures: the `embree` renderer with effects that a rasteriser does not have.
#pragma once

#include <cstdint>
#include <optional>

#include "semblance/render/renderer.h"

namespace semblance {

/// A distant lamp besides the scene's own light: it adds albedo * radiance * max(0, normal . l)
/// where no surface stands between, with the interpolated normal.
struct DirectionalLight {
  Eigen::Vector3d towards_light = Eigen::Vector3d::UnitY();  // world frame, any length but zero
  Eigen::Vector3f radiance = Eigen::Vector3f::Ones();        // linear RGB
  bool shadows = true;
};

struct RayTraceOptions {
  /// Colour is the mean over this many places spread over the pixel; one means the pixel's centre.
  int samples_per_pixel = 1;
  std::uint64_t seed = 1;  // of the places and of the occlusion rays
  std::optional<DirectionalLight> lamp;
  /// The scene's own light is scaled by the share of this many cosine-distributed rays per sample
  /// that meet nothing within the distance. None: no ambient occlusion.
  int occlusion_rays = 0;
  double occlusion_distance_m = 0.05;
};

/// Draws a scene with rays. All channels but colour show what the pixel's centre sees. The result
/// depends on the seed but not on the number of threads. Throws InvalidInput for what no renderer
/// draws, and for options out of range.
Frame ray_trace(const Scene& scene, const Camera& camera, Channel channels,
                const RayTraceOptions& options = {});

}  // namespace semblance
