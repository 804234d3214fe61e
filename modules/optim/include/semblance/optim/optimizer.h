// One interface for every optimizer, and the table of those there are.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "semblance/core/progress.h"
#include "semblance/optim/objective.h"

namespace semblance {

enum class Termination { converged, iteration_limit, evaluation_limit, cancelled, failed };

struct TracePoint {
  std::int64_t evaluations = 0;
  double seconds = 0.0;
  double cost = 0.0;  // best so far
};

struct Solution {
  Eigen::VectorXd x;
  double cost = 0.0;
  Termination termination = Termination::failed;
  std::int64_t evaluations = 0;  // one for evaluate, one for normal_equations
  std::vector<TracePoint> trace;
  /// Inverse of the Gauss-Newton Hessian at x, in the tangent space, for residuals of unit
  /// variance; absent where the optimizer has none or the Hessian is singular.
  std::optional<Eigen::MatrixXd> covariance;
  std::string message;
};

struct OptimizerOptions {
  int max_iterations = 30;              // of the gradient methods
  std::int64_t max_evaluations = 2000;  // of the sampling methods
  double step_tolerance = 1e-4;         // converged: every step below this times tangent_scale()
  double cost_tolerance = 1e-6;         // converged: relative decrease below this
  double initial_damping = 1e-4;        // of Levenberg-Marquardt, relative to the diagonal
  double search_radius = 1.0;           // of the sampling methods, in units of tangent_scale()
  int population = 24;                  // of swarm, CMA-ES, interacting annealing, particle filter
  std::uint64_t seed = 1;
};

/// A method. `minimize` starts at x0 clamped to its bounds, and never returns a cost above that of
/// the start nor a non-finite x. Of `progress` it only asks whether to stop: it runs inside a task
/// of its caller's. Throws InvalidInput if x0 has the wrong size or is not finite.
class Optimizer {
 public:
  virtual ~Optimizer() = default;
  virtual std::string name() const = 0;
  virtual Solution minimize(const Objective& objective, const Eigen::VectorXd& x0,
                            Progress& progress) const = 0;
};

/// Names for make_optimizer: lm, ceres, anneal, interacting, particle, pso, cmaes.
std::vector<std::string> optimizer_names();
/// Throws InvalidInput listing the names if there is no such optimizer. To add one: implement
/// Optimizer in a file of its own and add a line to the table in optimizer.cc.
std::unique_ptr<Optimizer> make_optimizer(const std::string& name, const OptimizerOptions& options);

}  // namespace semblance
