#include "sampling.h"

#include <cmath>

#include "semblance/core/errors.h"

namespace semblance {

Search::Search(Run& run, const Objective& objective, const OptimizerOptions& options)
    : run_(run),
      space_(objective.space()),
      options_(options),
      unit_(options.search_radius * space_.tangent_scale()),
      start_cost_(run.evaluate(run.start())) {
  Eigen::VectorXd lower, upper;
  space_.tangent_bounds(run.start(), lower, upper);
  lower_ = lower.cwiseQuotient(unit_).cwiseMax(-1.0);
  upper_ = upper.cwiseQuotient(unit_).cwiseMin(1.0);
}

double Search::used() const {
  return std::min(
      1.0, static_cast<double>(run_.evaluations()) / static_cast<double>(options_.max_evaluations));
}

std::vector<double> Search::evaluate(const std::vector<Eigen::VectorXd>& ys) {
  if (run_.cancelled()) throw Stop{Termination::cancelled, "cancelled"};
  if (run_.evaluations() + static_cast<std::int64_t>(ys.size()) > options_.max_evaluations) {
    throw Stop{Termination::evaluation_limit, "reached the limit of evaluations"};
  }
  std::vector<Eigen::VectorXd> xs;
  xs.reserve(ys.size());
  for (const Eigen::VectorXd& y : ys) {
    xs.push_back(space_.plus(run_.start(), unit_.cwiseProduct(y)));
  }
  return run_.evaluate_batch(xs);
}

void Search::stop_if_collapsed(const std::vector<Eigen::VectorXd>& ys) const {
  Eigen::VectorXd least = ys.front(), most = ys.front();
  for (const Eigen::VectorXd& y : ys) {
    least = least.cwiseMin(y);
    most = most.cwiseMax(y);
  }
  if ((most - least).maxCoeff() <= tolerance()) {
    throw Stop{Termination::converged, "the population spans less than the step tolerance"};
  }
}

Eigen::VectorXd Search::reflect(Eigen::VectorXd y) const {
  for (Eigen::Index i = 0; i < y.size(); ++i) {
    const double width = upper_[i] - lower_[i];
    if (!(width > 0.0)) {
      y[i] = lower_[i];
      continue;
    }
    double phase = std::fmod(y[i] - lower_[i], 2.0 * width);
    if (phase < 0.0) phase += 2.0 * width;
    y[i] = lower_[i] + (phase <= width ? phase : 2.0 * width - phase);
  }
  return y;
}

SamplingOptimizer::SamplingOptimizer(const OptimizerOptions& options) : options_(options) {
  if (options.population < 5) throw InvalidInput("population must be at least 5");
  if (options.max_evaluations < 1) throw InvalidInput("max_evaluations must be at least 1");
  if (!(options.search_radius > 0.0)) throw InvalidInput("search_radius must be positive");
}

Solution SamplingOptimizer::minimize(const Objective& objective, const Eigen::VectorXd& x0,
                                     Progress& progress) const {
  Run run(objective, x0, progress);
  Search search(run, objective, options_);
  try {
    for (;;) sample(search);
  } catch (const Stop& stop) {
    if (!std::isfinite(run.best_cost())) {
      return run.finish(Termination::failed, "no point with a finite cost was found");
    }
    return run.finish(stop.termination, stop.message);
  }
}

}  // namespace semblance
