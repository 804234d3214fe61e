// Distance between points of the model and their marks in the image.
#pragma once

#include <vector>

#include "semblance/cost/cost.h"

namespace semblance {

/// A place on the surface and where it should appear.
struct LandmarkTarget {
  int triangle = 0;
  std::array<float, 3> barycentric{1, 0, 0};
  Eigen::Vector2d target_px;  // of the full image
  double sigma_px = 1.0;
};

/// Residuals (projection - target) / sigma with Geman-McClure's loss of width `robust_width`
/// deviations, so that one mark on the wrong feature cannot pull the face away.
class LandmarkCost : public Cost {
 public:
  LandmarkCost(std::vector<LandmarkTarget> targets, const SurfaceTopology* topology,
               double full_width_px, double robust_width);
  std::string name() const override { return "landmark"; }
  std::string unit() const override { return "px"; }
  double evaluate(const Synthesis& synthesis, SurfaceEquations* surface,
                  NormalEquations* direct) const override;

 private:
  std::vector<LandmarkTarget> targets_;
  const SurfaceTopology* topology_;
  double full_width_px_;
  double robust_width_;
};

}  // namespace semblance
