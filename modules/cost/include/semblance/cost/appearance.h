// How the surface looks: albedo gathered from the images, light, and how far to trust each place.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "semblance/core/scene.h"
#include "semblance/cost/observation.h"
#include "semblance/cost/texture_atlas.h"
#include "semblance/render/visibility.h"

namespace semblance {

/// Texture pyramid of encoded albedo (root of linear) and confidence in [0, 1]: 4 floats a texel.
struct AlbedoPyramid {
  struct Level {
    int width = 0, height = 0;
    std::vector<float> texels;
  };
  std::vector<Level> levels;
};

/// Albedo by inverse mapping. Each texel is the mean of the first views that saw it and then never
/// changes: that anchors the texture, so that small errors of later poses cannot become drift.
class Appearance {
 public:
  /// `vertex_colour`: linear albedo assumed where no image has shown the surface yet;
  /// `prior_confidence`: how far such places count (per vertex, in [0, 1]).
  Appearance(const Mesh& mesh, int texture_size, const PointsF& vertex_colour,
             const std::vector<float>& prior_confidence);

  /// Averages what `observed` shows of the posed `object` through `camera` into the texels that are
  /// not final yet. A view counts by the squared cosine between normal and ray times the inlier
  /// weight of the pixel (`pixel_weight` per entry of `pixels`); a texel is final once its views
  /// count 4 in sum.
  void gather(const Image& observed_linear, const SceneObject& object, const Camera& camera,
              const ShLight& light, const VisiblePixels& pixels,
              const std::vector<float>& pixel_weight);
  /// Colours for unseen texels of given vertices (the colour of the skin, once it is known).
  void set_prior_colour(const PointsF& vertex_colour);

  const AlbedoPyramid& albedo() const { return pyramid_; }
  /// Linear RGB texture for renderers and files.
  Image texture() const;
  double seen_fraction() const;

  /// All that changes, for checkpoints.
  std::vector<float>& state() { return seen_; }
  const std::vector<float>& state() const { return seen_; }
  /// Call after restoring `state`.
  void rebuild();

 private:
  TextureAtlas atlas_;
  Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor> triangles_;
  std::vector<float> prior_;  // encoded colour and confidence per atlas entry
  std::vector<float> prior_confidence_;
  std::vector<float> seen_;  // encoded colour and weight per atlas entry
  AlbedoPyramid pyramid_;
};

}  // namespace semblance
