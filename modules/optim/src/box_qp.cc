#include "box_qp.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <vector>

namespace semblance {
namespace {

/// The state of the active-set method.
class BoxQp {
 public:
  BoxQp(const Eigen::MatrixXd& hessian, const Eigen::VectorXd& gradient,
        const Eigen::VectorXd& lower, const Eigen::VectorXd& upper, Eigen::VectorXd& d)
      : hessian_(hessian), gradient_(gradient), lower_(lower), upper_(upper), d_(d) {}

  bool solve();

 private:
  bool wants_out(Eigen::Index i, double slope) const {
    return (d_[i] <= lower_[i] && slope >= 0.0) || (d_[i] >= upper_[i] && slope <= 0.0);
  }
  /// Minimises over the free directions up to the first bound met, which is then held. Returns
  /// false if the hessian is not positive definite.
  bool advance(bool& met_bound);
  /// Frees the held direction that gains most; false if none gains anything.
  bool release();

  const Eigen::MatrixXd& hessian_;
  const Eigen::VectorXd &gradient_, &lower_, &upper_;
  Eigen::VectorXd& d_;
  std::vector<char> held_;
};

bool BoxQp::advance(bool& met_bound) {
  std::vector<Eigen::Index> free;
  for (Eigen::Index i = 0; i < d_.size(); ++i) {
    if (held_[i] == 0) free.push_back(i);
  }
  met_bound = false;
  if (free.empty()) return true;
  const Eigen::LLT<Eigen::MatrixXd> llt(hessian_(free, free));
  if (llt.info() != Eigen::Success) return false;
  const Eigen::VectorXd slope = gradient_ + hessian_ * d_;
  const Eigen::VectorXd step = -llt.solve(Eigen::VectorXd(slope(free)));

  double length = 1.0;
  Eigen::Index blocking = -1;
  for (std::size_t k = 0; k < free.size(); ++k) {
    const Eigen::Index i = free[k];
    const double room = (step[k] < 0.0 ? lower_[i] : upper_[i]) - d_[i];
    if (std::abs(room) >= length * std::abs(step[k])) continue;
    length = room / step[k];
    blocking = i;
  }
  d_(free) += length * step;
  d_ = d_.cwiseMax(lower_).cwiseMin(upper_);
  if (blocking < 0) return true;
  const bool at_lower = d_[blocking] - lower_[blocking] < upper_[blocking] - d_[blocking];
  d_[blocking] = at_lower ? lower_[blocking] : upper_[blocking];
  held_[blocking] = 1;
  met_bound = true;
  return true;
}

bool BoxQp::release() {
  constexpr double negligible = 1e-16;
  const Eigen::VectorXd slope = gradient_ + hessian_ * d_;
  const double reached = std::abs(d_.dot(gradient_ + 0.5 * (hessian_ * d_)));
  double best_gain = negligible * reached;
  Eigen::Index best = -1;
  for (Eigen::Index i = 0; i < d_.size(); ++i) {
    if (held_[i] == 0 || wants_out(i, slope[i]) || lower_[i] >= upper_[i]) continue;
    const double gain = 0.5 * slope[i] * slope[i] / hessian_(i, i);
    if (gain <= best_gain) continue;
    best_gain = gain;
    best = i;
  }
  if (best < 0) return false;
  held_[best] = 0;
  return true;
}

bool BoxQp::solve() {
  const Eigen::Index n = gradient_.size();
  d_ = Eigen::VectorXd::Zero(n);
  held_.assign(static_cast<std::size_t>(n), 0);
  for (Eigen::Index i = 0; i < n; ++i) {
    held_[i] = lower_[i] >= upper_[i] || wants_out(i, gradient_[i]);
  }
  // Every pass lowers the cost or shrinks the free set; the limit only guards against rounding.
  for (Eigen::Index pass = 0; pass < 10 * n + 20; ++pass) {
    bool met_bound = false;
    if (!advance(met_bound)) return false;
    if (!met_bound && !release()) break;
  }
  return true;
}

}  // namespace

bool solve_box_qp(const Eigen::MatrixXd& hessian, const Eigen::VectorXd& gradient,
                  const Eigen::VectorXd& lower, const Eigen::VectorXd& upper, Eigen::VectorXd& d) {
  return BoxQp(hessian, gradient, lower, upper, d).solve();
}

}  // namespace semblance
