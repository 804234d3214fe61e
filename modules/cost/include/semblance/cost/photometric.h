// Difference between the synthesised and the observed image.
#pragma once

#include <memory>
#include <vector>

#include "semblance/cost/appearance.h"
#include "semblance/cost/cost.h"
#include "semblance/cost/observation.h"

namespace semblance {

struct PhotometricOptions {
  double sigma = 0.03;        // deviation of an inlier's residual (encoded intensity)
  double robust_width = 3.0;  // Geman-McClure: residuals of so many sigma count a quarter
  /// Residuals of neighbouring pixels are not independent: their model errors are the same. The sum
  /// is divided by this number of pixels, which makes its Hessian comparable with priors.
  double correlation_area_px = 8.0;
  /// Number of pixels the mean residual is multiplied with; 0: those visible at the x evaluated.
  double reference_pixels = 0.0;
  int texture_level = 0;  // of the albedo pyramid: see matching_texture_level
};

/// Level of the albedo pyramid whose texels are about as large as the pixels of the synthesis.
int matching_texture_level(const Synthesis& synthesis, const Appearance& appearance,
                           const SurfaceTopology& topology);

/// The visible pixels, 4 floats each: encoded red, green, blue, and weight (the albedo's confidence
/// times the triangle's weight).
struct ShadedPixels {
  std::vector<float> colour;
};

/// Residual per pixel and channel: encode(albedo * light) - encode(observed), in encoded intensity.
/// The cost is the weighted mean of Geman-McClure's rho over the visible pixels of the scene's only
/// object, times `reference_pixels`: hiding a bad pixel gains nothing. Throws InvalidInput for
/// scenes of several objects and textures smaller than 2 x 2.
class PhotometricCost : public Cost {
 public:
  PhotometricCost(const ObservationLevel* observation, const Appearance* appearance,
                  const SurfaceTopology* topology, const std::vector<float>* triangle_weight,
                  const PhotometricOptions& options);

  std::string name() const override { return "photometric"; }
  std::string unit() const override { return "encoded intensity"; }
  double evaluate(const Synthesis& synthesis, SurfaceEquations* surface,
                  NormalEquations* direct) const override;

  /// The synthetic picture at the visible pixels. Returns the sum of the weights.
  double shade(const Synthesis& synthesis, ShadedPixels& out) const;

  /// Facts about the fit at one synthesis.
  struct Statistics {
    double rms = 0.0;              // encoded intensity, all channels, inliers and outliers
    double inlier_fraction = 0.0;  // weight share of pixels below robust_width sigma
    double sigma = 0.0;            // robust deviation: 1.4826 median |r|
    double correlation = 0.0;      // normalised cross-correlation of synthetic and observed
    double lag_correlation = 0.0;  // of residuals of neighbouring pixels
    std::size_t pixels = 0;
    std::vector<float> pixel_weight;  // robust weight of each pixel in [0, 1]
  };
  Statistics statistics(const Synthesis& synthesis) const;

 private:
  const ObservationLevel* observation_;
  const Appearance* appearance_;
  const SurfaceTopology* topology_;
  const std::vector<float>* triangle_weight_;
  PhotometricOptions options_;
};

}  // namespace semblance
