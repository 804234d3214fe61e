// Quadratic programs with bounds only.
#pragma once

#include <Eigen/Core>

namespace semblance {

/// The d within [lower, upper] that minimises gradient'd + d'hessian d / 2, for a positive definite
/// hessian and bounds that contain 0. Projected Newton with an active set (Bertsekas 1982, in the
/// form of Tassa, Mansard and Todorov 2014, section III.B). Returns false if the hessian is not
/// positive definite to working precision.
bool solve_box_qp(const Eigen::MatrixXd& hessian, const Eigen::VectorXd& gradient,
                  const Eigen::VectorXd& lower, const Eigen::VectorXd& upper, Eigen::VectorXd& d);

}  // namespace semblance
