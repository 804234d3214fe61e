// Levenberg-Marquardt on the normal equations, the optimizer of the frame loop.
//
// Damping follows the gain ratio (Nielsen 1999, also Madsen, Nielsen and Tingleff 2004, algorithm
// 3.16) and is relative to the diagonal of the Hessian (Marquardt 1963), so that parameters of any
// unit mix. Bounds enter the subproblem itself: each step minimises the damped quadratic model
// within the box.
#include <cmath>

#include "box_qp.h"
#include "methods.h"
#include "run.h"

namespace semblance {
namespace {

class LevenbergMarquardt final : public Optimizer {
 public:
  explicit LevenbergMarquardt(const OptimizerOptions& options) : options_(options) {}
  std::string name() const override { return "lm"; }
  Solution minimize(const Objective& objective, const Eigen::VectorXd& x0,
                    Progress& progress) const override;

 private:
  OptimizerOptions options_;
};

/// Diagonal that the damping multiplies. Directions that the data hardly see get a small share of
/// the strongest one, so that the damped Hessian stays positive definite.
Eigen::VectorXd damping_diagonal(const Eigen::MatrixXd& hessian, const Eigen::VectorXd& scale) {
  constexpr double share = 1e-6;
  const Eigen::VectorXd scaled = hessian.diagonal().cwiseProduct(scale.cwiseAbs2());
  const double floor = std::max(share * scaled.maxCoeff(), 1e-300);
  return scaled.cwiseMax(floor).cwiseQuotient(scale.cwiseAbs2());
}

/// The bounded damped step from x. Raises `damping` until the system is positive definite.
Eigen::VectorXd damped_step(const ParameterSpace& space, const Eigen::VectorXd& x,
                            const NormalEquations& model, double& damping) {
  Eigen::VectorXd lower, upper, step;
  space.tangent_bounds(x, lower, upper);
  const Eigen::VectorXd diagonal = damping_diagonal(model.hessian, space.tangent_scale());
  for (;;) {
    Eigen::MatrixXd damped = model.hessian;
    damped.diagonal() += damping * diagonal;
    if (solve_box_qp(damped, model.gradient, lower, upper, step) && step.allFinite()) return step;
    damping = std::max(10.0 * damping, 1e-10);
  }
}

Solution LevenbergMarquardt::minimize(const Objective& objective, const Eigen::VectorXd& x0,
                                      Progress& progress) const {
  const ParameterSpace& space = objective.space();
  const Eigen::VectorXd scale = space.tangent_scale();
  Run run(objective, x0, progress);
  Eigen::VectorXd x = run.start();
  NormalEquations model, trial_model;
  const auto finish = [&](Termination termination, const std::string& message) {
    Solution solution = run.finish(termination, message);
    solution.covariance = covariance_from_hessian(model.hessian, scale);
    return solution;
  };
  if (!run.normal_equations(x, model)) {
    run.evaluate(x);
    return run.finish(Termination::failed, "the start cannot be evaluated");
  }

  double damping = options_.initial_damping, growth = 2.0;
  bool rejected = false;
  for (int iteration = 0; iteration < options_.max_iterations; ++iteration) {
    if (run.cancelled()) return finish(Termination::cancelled, "cancelled");
    const Eigen::VectorXd step = damped_step(space, x, model, damping);
    const double predicted = -step.dot(model.gradient + 0.5 * (model.hessian * step));
    if ((step.array().abs() <= options_.step_tolerance * scale.array()).all()) {
      return finish(Termination::converged, "the step is below its tolerance");
    }
    if (predicted <= options_.cost_tolerance * model.cost) {
      return finish(Termination::converged, "the expected decrease is below its tolerance");
    }

    // Most trials are accepted and their normal equations are needed then, so a trial is evaluated
    // by them at once; after a rejection the plain cost, at about half the price, comes first.
    const Eigen::VectorXd trial = space.plus(x, step);
    const bool usable =
        (!rejected || run.evaluate(trial) < model.cost) && run.normal_equations(trial, trial_model);
    const double decrease = usable ? model.cost - trial_model.cost : -1.0;
    rejected = !(decrease > 0.0);
    if (rejected) {
      damping = std::max(damping, 1e-12) * growth;
      growth *= 2.0;
      continue;
    }
    const double before = model.cost, surprise = 2.0 * decrease / predicted - 1.0;
    x = trial;
    std::swap(model, trial_model);
    damping *= std::max(1.0 / 3.0, 1.0 - surprise * surprise * surprise);
    growth = 2.0;
    if (decrease <= options_.cost_tolerance * before) {
      return finish(Termination::converged, "the decrease is below its tolerance");
    }
  }
  return finish(Termination::iteration_limit, "reached the limit of iterations");
}

}  // namespace

std::unique_ptr<Optimizer> make_lm(const OptimizerOptions& options) {
  return std::make_unique<LevenbergMarquardt>(options);
}

}  // namespace semblance
