// What every optimizer minimises.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "semblance/optim/parameter_space.h"

namespace semblance {

/// Gauss-Newton model of a cost around x, in the tangent space of its ParameterSpace:
/// cost(plus(x, d)) ~ cost + gradient'd + d'hessian d / 2, where cost = sum rho(r^2) / 2,
/// gradient = J'W r, hessian = J'W J with the robust weights W.
struct NormalEquations {
  Eigen::MatrixXd hessian;
  Eigen::VectorXd gradient;
  double cost = 0.0;

  void reset(Eigen::Index size) {
    hessian.setZero(size, size);
    gradient.setZero(size);
    cost = 0.0;
  }
};

/// A cost over a ParameterSpace. The const functions may be called from several threads at once.
class Objective {
 public:
  virtual ~Objective() = default;
  virtual const ParameterSpace& space() const = 0;

  /// Cost at x, non-negative; +infinity where x cannot be evaluated, never NaN.
  virtual double evaluate(const Eigen::VectorXd& x) const = 0;
  /// costs[i] = evaluate(xs[i]): the one place where optimizers use threads.
  virtual void evaluate_batch(std::span<const Eigen::VectorXd> xs, std::span<double> costs) const;
  /// Cost, gradient and Gauss-Newton Hessian at x. Returns false where x cannot be evaluated. The
  /// default differentiates `evaluate` centrally and takes the Hessian from differences too, which
  /// costs 2 n^2 evaluations: fine for toys, to be overridden for images.
  virtual bool normal_equations(const Eigen::VectorXd& x, NormalEquations& out) const;
};

}  // namespace semblance
