// The bookkeeping that every optimizer needs, in one place.
#pragma once

#include <chrono>
#include <span>
#include <vector>

#include "semblance/optim/optimizer.h"

namespace semblance {

/// One minimisation: counts evaluations, keeps the best point and the trace, watches for
/// cancellation. Because `finish` returns the best point seen, the start included, no optimizer can
/// end above its start or at a point whose cost is not finite.
class Run {
 public:
  /// The start is x0 clamped to its bounds. Throws InvalidInput if x0 has the wrong size or is not
  /// finite.
  Run(const Objective& objective, const Eigen::VectorXd& x0, Progress& progress);

  const Eigen::VectorXd& start() const { return start_; }
  const Eigen::VectorXd& best() const { return best_; }
  double best_cost() const { return best_cost_; }
  std::int64_t evaluations() const { return evaluations_; }
  bool cancelled() const { return progress_.cancelled(); }

  double evaluate(const Eigen::VectorXd& x);
  std::vector<double> evaluate_batch(std::span<const Eigen::VectorXd> xs);
  /// False where x cannot be evaluated or the result is not finite.
  bool normal_equations(const Eigen::VectorXd& x, NormalEquations& out);

  /// The best point, without covariance.
  Solution finish(Termination termination, const std::string& message);

 private:
  void record(const Eigen::VectorXd& x, double cost);

  const Objective& objective_;
  Progress& progress_;
  std::chrono::steady_clock::time_point began_;
  Eigen::VectorXd start_, best_;
  double best_cost_;
  std::int64_t evaluations_ = 0;
  std::vector<TracePoint> trace_;
};

/// Inverse of a Gauss-Newton Hessian, computed in units of `scale`; empty if it is singular to
/// working precision.
std::optional<Eigen::MatrixXd> covariance_from_hessian(const Eigen::MatrixXd& hessian,
                                                       const Eigen::VectorXd& scale);

}  // namespace semblance
