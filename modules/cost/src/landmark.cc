#include "semblance/cost/landmark.h"

namespace semblance {

LandmarkCost::LandmarkCost(std::vector<LandmarkTarget> targets, const SurfaceTopology* topology,
                           double full_width_px, double robust_width)
    : targets_(std::move(targets)),
      topology_(topology),
      full_width_px_(full_width_px),
      robust_width_(robust_width) {}

double LandmarkCost::evaluate(const Synthesis& synthesis, SurfaceEquations* surface,
                              NormalEquations* direct) const {
  (void)direct;
  const double scale = synthesis.camera.width / full_width_px_;  // level pixels per full pixel
  double cost = 0.0;
  for (const LandmarkTarget& target : targets_) {
    const auto& corner = topology_->triangles[target.triangle];
    Eigen::Vector2d seen = Eigen::Vector2d::Zero();
    for (int k = 0; k < 3; ++k) {
      const float* p = synthesis.projected.data() + 3 * std::ptrdiff_t{corner[k]};
      seen += target.barycentric[k] * Eigen::Vector2d(p[0], p[1]);
    }
    const double sigma = target.sigma_px * scale;
    const Eigen::Vector2d residual = (seen - scale * target.target_px) / sigma;
    const double s = residual.squaredNorm();
    const double q = 1.0 / (1.0 + s / (robust_width_ * robust_width_));
    cost += 0.5 * s * q;
    if (surface != nullptr) {
      const auto m = static_cast<float>(q * q / (sigma * sigma));
      const Eigen::Vector2f v = (q * q / sigma * residual).cast<float>();
      surface->add(target.triangle, target.barycentric[0], target.barycentric[1],
                   target.barycentric[2], m, 0.0f, m, v.x(), v.y());
    }
  }
  return cost;
}

}  // namespace semblance
