// What every Optimizer and every Objective must satisfy, as functions that a test of an extension
// can call. They need no test framework; the two macros at the end are for GoogleTest.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>

#include "semblance/optim/optimizer.h"

namespace semblance {

/// How close an optimizer must come on the three problems with known answers.
struct OptimizerAccuracy {
  std::int64_t evaluations = 20000;  // budget of the sampling methods
  double quadratic = 1e-4;           // largest error of x; 5 parameters, condition 100
  double rosenbrock = 1e-3;          // largest error of x; 2 parameters, from (-1.2, 1)
  double rotation_rad = 1e-4;        // angle to the closed form of Wahba's problem
};

using OptimizerMaker = std::function<std::unique_ptr<Optimizer>(const OptimizerOptions&)>;

/// One line for each broken promise, empty if there is none. Checked: converges on a quadratic, on
/// Rosenbrock's function and on Wahba's problem (the rotation that best aligns directions; closed
/// form by singular values, Markley 1988); never ends above the start or outside the bounds; the
/// same result for a seed with one and two threads; stops soon after cancellation with the best so
/// far; counts its evaluations; survives regions of infinite cost, a start in one included.
std::string optimizer_contract_violations(const OptimizerMaker& make,
                                          const OptimizerAccuracy& accuracy);

/// Relative errors allowed between `normal_equations` and differences of `evaluate`.
struct ObjectiveAccuracy {
  double cost = 1e-9;
  double gradient = 1e-5;
  double relative_step = 1e-5;  // of the differences, in units of tangent_scale()
  bool gauss_newton = true;     // half the gradient's squared Newton norm is at most the cost
};

/// One line for each broken promise at the given points, empty if there is none. Checked: the cost
/// of `normal_equations` is that of `evaluate`; the gradient equals central differences, relative
/// to its own norm plus a part of sqrt(2 cost * trace of the Hessian), all in units of
/// tangent_scale(); the Hessian is symmetric, positive semidefinite and belongs to least squares;
/// `evaluate_batch` and calls from several threads give the same numbers as single calls. The
/// points must keep `relative_step` away from the bounds.
std::string objective_contract_violations(const Objective& objective,
                                          std::span<const Eigen::VectorXd> points,
                                          const ObjectiveAccuracy& accuracy);

}  // namespace semblance

#define EXPECT_OPTIMIZER_CONTRACT(make, accuracy) \
  EXPECT_EQ("", ::semblance::optimizer_contract_violations(make, accuracy))
#define EXPECT_OBJECTIVE_CONTRACT(objective, points, accuracy) \
  EXPECT_EQ("", ::semblance::objective_contract_violations(objective, points, accuracy))
