#include "run.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

#include "semblance/core/errors.h"

namespace semblance {

Run::Run(const Objective& objective, const Eigen::VectorXd& x0, Progress& progress)
    : objective_(objective),
      progress_(progress),
      began_(std::chrono::steady_clock::now()),
      best_cost_(std::numeric_limits<double>::infinity()) {
  const ParameterSpace& space = objective.space();
  if (x0.size() != space.size()) {
    throw InvalidInput("the start has " + std::to_string(x0.size()) +
                       " entries, the parameter space has " + std::to_string(space.size()));
  }
  if (space.tangent_size() == 0) throw InvalidInput("the parameter space is empty");
  if (!x0.allFinite()) throw InvalidInput("the start has entries that are not finite");
  start_ = best_ = space.plus(x0, Eigen::VectorXd::Zero(space.tangent_size()));
}

void Run::record(const Eigen::VectorXd& x, double cost) {
  if (!(cost < best_cost_)) return;
  best_cost_ = cost;
  best_ = x;
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - began_;
  trace_.push_back({evaluations_, elapsed.count(), cost});
}

double Run::evaluate(const Eigen::VectorXd& x) {
  const double cost = objective_.evaluate(x);
  ++evaluations_;
  record(x, cost);
  return cost;
}

std::vector<double> Run::evaluate_batch(std::span<const Eigen::VectorXd> xs) {
  std::vector<double> costs(xs.size());
  objective_.evaluate_batch(xs, costs);
  evaluations_ += static_cast<std::int64_t>(xs.size());
  for (std::size_t i = 0; i < xs.size(); ++i) record(xs[i], costs[i]);
  return costs;
}

bool Run::normal_equations(const Eigen::VectorXd& x, NormalEquations& out) {
  const bool usable = objective_.normal_equations(x, out) && std::isfinite(out.cost) &&
                      out.gradient.allFinite() && out.hessian.allFinite();
  ++evaluations_;
  if (usable) record(x, out.cost);
  return usable;
}

Solution Run::finish(Termination termination, const std::string& message) {
  Solution solution;
  solution.x = best_;
  solution.cost = best_cost_;
  solution.termination = termination;
  solution.evaluations = evaluations_;
  solution.trace = std::move(trace_);
  solution.message = message;
  return solution;
}

std::optional<Eigen::MatrixXd> covariance_from_hessian(const Eigen::MatrixXd& hessian,
                                                       const Eigen::VectorXd& scale) {
  const Eigen::MatrixXd scaled = scale.asDiagonal() * hessian * scale.asDiagonal();
  const Eigen::VectorXd deviation = scaled.diagonal().cwiseMax(0.0).cwiseSqrt();
  if (!(deviation.array() > 0.0).all()) return std::nullopt;
  const Eigen::VectorXd inverse = deviation.cwiseInverse();
  const Eigen::LLT<Eigen::MatrixXd> llt(inverse.asDiagonal() * scaled * inverse.asDiagonal());
  constexpr double smallest_rcond = 1e-13;
  if (llt.info() != Eigen::Success || !(llt.rcond() > smallest_rcond)) return std::nullopt;
  const Eigen::VectorXd back = inverse.cwiseProduct(scale);
  const Eigen::MatrixXd inverted =
      llt.solve(Eigen::MatrixXd::Identity(hessian.rows(), hessian.cols()));
  return back.asDiagonal() * inverted * back.asDiagonal();
}

}  // namespace semblance
