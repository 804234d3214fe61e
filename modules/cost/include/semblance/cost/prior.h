// Gaussian priors on parameters.
#pragma once

#include "semblance/cost/cost.h"

namespace semblance {

/// |minus(x, mean) / sigma|^2 / 2 over the tangent space; entries with infinite sigma do not count.
class PriorCost : public Cost {
 public:
  PriorCost(Eigen::VectorXd mean, Eigen::VectorXd tangent_sigma);
  /// The priors that the space itself declares.
  explicit PriorCost(const ParameterSpace& space);
  std::string name() const override { return "prior"; }
  std::string unit() const override { return "parameter"; }
  double evaluate(const Synthesis& synthesis, SurfaceEquations* surface,
                  NormalEquations* direct) const override;

 private:
  Eigen::VectorXd mean_, information_;
};

}  // namespace semblance
