// What the optimizers that only sample the cost have in common.
#pragma once

#include <string>
#include <vector>

#include "run.h"

namespace semblance {

/// Thrown by `Search::evaluate` to end a search, also out of a library's own loop.
struct Stop {
  Termination termination;
  std::string message;
};

/// The box of a search, in units of the radius: y = 0 is the start, y_i = +-1 is search_radius *
/// tangent_scale_i away from it unless a bound comes first.
class Search {
 public:
  Search(Run& run, const Objective& objective, const OptimizerOptions& options);

  const OptimizerOptions& options() const { return options_; }
  Eigen::Index size() const { return lower_.size(); }
  const Eigen::VectorXd& lower() const { return lower_; }
  const Eigen::VectorXd& upper() const { return upper_; }
  double start_cost() const { return start_cost_; }
  /// Steps below this in every direction count as converged.
  double tolerance() const { return options_.step_tolerance / options_.search_radius; }
  /// Share of the budget of evaluations that is used up.
  double used() const;

  /// Costs at the ys, each inside the box. Throws Stop when cancelled and when the batch would
  /// exceed the budget.
  std::vector<double> evaluate(const std::vector<Eigen::VectorXd>& ys);
  /// Throws Stop once every direction of the population spans less than the tolerance.
  void stop_if_collapsed(const std::vector<Eigen::VectorXd>& ys) const;
  /// y mirrored at the faces of the box until it is inside.
  Eigen::VectorXd reflect(Eigen::VectorXd y) const;

 private:
  Run& run_;
  const ParameterSpace& space_;
  OptimizerOptions options_;
  Eigen::VectorXd unit_, lower_, upper_;
  double start_cost_;
};

/// An optimizer that is a search: subclasses sample until Stop, the rest is done here.
class SamplingOptimizer : public Optimizer {
 public:
  explicit SamplingOptimizer(const OptimizerOptions& options);
  Solution minimize(const Objective& objective, const Eigen::VectorXd& x0,
                    Progress& progress) const final;

 private:
  /// Samples through `search` for ever; it is ended by Stop.
  virtual void sample(Search& search) const = 0;
  OptimizerOptions options_;
};

}  // namespace semblance
