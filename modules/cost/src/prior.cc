#include "semblance/cost/prior.h"

#include <cmath>

namespace semblance {

PriorCost::PriorCost(Eigen::VectorXd mean, Eigen::VectorXd tangent_sigma)
    : mean_(std::move(mean)), information_(tangent_sigma.unaryExpr([](double sigma) {
        return std::isfinite(sigma) ? 1.0 / (sigma * sigma) : 0.0;
      })) {}

PriorCost::PriorCost(const ParameterSpace& space)
    : PriorCost(space.initial(), space.tangent_prior_sigma()) {}

double PriorCost::evaluate(const Synthesis& synthesis, SurfaceEquations* surface,
                           NormalEquations* direct) const {
  (void)surface;
  const Eigen::VectorXd d = synthesis.space.minus(synthesis.x, mean_);
  if (direct != nullptr) {
    direct->gradient += information_.cwiseProduct(d);
    direct->hessian.diagonal() += information_;
  }
  return 0.5 * d.cwiseAbs2().dot(information_);
}

}  // namespace semblance
