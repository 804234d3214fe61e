// Quadratic programs with bounds only.
#pragma once

#include <Eigen/Core>

namespace semblance {

/// The d within [lower, upper] that minimises gradient'd + d'hessian d / 2, for a positive definite
/// hessian and bounds that contain 0; entries held by a bound equal it exactly. Primal active set
/// (Nocedal and Wright 2006, algorithm 16.3), which, unlike projected Newton steps, also gets
/// past bounds that are a rounding error away. Returns false if the hessian is not positive
/// definite to working precision.
bool solve_box_qp(const Eigen::MatrixXd& hessian, const Eigen::VectorXd& gradient,
                  const Eigen::VectorXd& lower, const Eigen::VectorXd& upper, Eigen::VectorXd& d);

}  // namespace semblance
