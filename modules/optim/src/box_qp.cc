#include "box_qp.h"

#include <Eigen/Cholesky>
#include <vector>

namespace semblance {

bool solve_box_qp(const Eigen::MatrixXd& hessian, const Eigen::VectorXd& gradient,
                  const Eigen::VectorXd& lower, const Eigen::VectorXd& upper, Eigen::VectorXd& d) {
  constexpr double sufficient_decrease = 0.1, relative_tolerance = 1e-10;
  const Eigen::Index n = gradient.size();
  const auto value = [&](const Eigen::VectorXd& at) {
    return at.dot(gradient + 0.5 * (hessian * at));
  };
  d.setZero(n);
  for (Eigen::Index pass = 0; pass < 2 * n + 10; ++pass) {
    const Eigen::VectorXd slope = gradient + hessian * d;
    std::vector<Eigen::Index> free;
    for (Eigen::Index i = 0; i < n; ++i) {
      const bool held =
          (d[i] <= lower[i] && slope[i] >= 0.0) || (d[i] >= upper[i] && slope[i] <= 0.0);
      if (!held) free.push_back(i);
    }
    if (free.empty() || slope(free).norm() <= relative_tolerance * gradient.norm()) return true;

    const Eigen::LLT<Eigen::MatrixXd> llt(hessian(free, free));
    if (llt.info() != Eigen::Success) return false;
    Eigen::VectorXd newton = Eigen::VectorXd::Zero(n);
    newton(free) = -llt.solve(Eigen::VectorXd(slope(free)));

    const double before = value(d);
    bool moved = false;
    for (double length = 1.0; length > 1e-6 && !moved; length *= 0.5) {
      const Eigen::VectorXd trial = (d + length * newton).cwiseMax(lower).cwiseMin(upper);
      moved = value(trial) - before < sufficient_decrease * slope.dot(trial - d);
      if (moved) d = trial;
    }
    if (!moved) return true;  // rounding: no further decrease can be resolved
  }
  return true;
}

}  // namespace semblance
