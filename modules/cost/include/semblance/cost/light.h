// Least squares for the light on a surface of known colours: point by point, or from a picture.
#pragma once

#include <Eigen/Core>
#include <array>

#include "semblance/core/scene.h"
#include "semblance/cost/appearance.h"
#include "semblance/cost/cost.h"
#include "semblance/cost/observation.h"

namespace semblance {

/// Sums over surface points; their light is that which explains the sums best.
class LightEquations {
 public:
  LightEquations();
  /// A point with `basis` = sh_basis(normal). Albedo and what is seen are encoded RGB; the error of
  /// the linear intensity is weighted so that `weight` is that of the encoded one, to first order.
  void add(const std::array<float, 9>& basis, const float* albedo, const float* observed,
           double weight);
  LightEquations& operator+=(const LightEquations& other);
  /// Solves each channel with a pull towards `before`, relative to the data's weight on the ambient
  /// term. `order`: of the harmonics that may change, 1 (ambient and direction) or 2. Channels that
  /// cannot be solved keep `before`.
  ShLight solve(const ShLight& before, double pull, int order) const;

 private:
  static constexpr int kProducts = 9 * 10 / 2;
  Eigen::Array<double, kProducts, 3> normal_;  // of each channel: the lower triangle by columns
  Eigen::Array<double, 9, 3> right_;
};

struct LightOptions {
  double pull = 0.05;  // strength of the pull towards the scene's light, relative to the data
  int order = 2;       // of the spherical harmonics that may change: 1 is ambient and direction
  int stride = 1;      // uses every stride-th pixel
};

/// Light that explains the observation best: weighted least squares on the linear scale, with
/// weights that undo the encoding. `pixel_weight` has one entry per visible pixel.
ShLight estimate_light(const Synthesis& synthesis, const ObservationLevel& observation,
                       const Appearance& appearance, const SurfaceTopology& topology,
                       const std::vector<float>& pixel_weight, const LightOptions& options);

}  // namespace semblance
