// Particle swarm and CMA-ES, by pagmo.
#include <memory>
#include <pagmo/algorithms/cmaes.hpp>
#include <pagmo/algorithms/pso_gen.hpp>
#include <pagmo/batch_evaluators/member_bfe.hpp>
#include <pagmo/bfe.hpp>
#include <pagmo/population.hpp>
#include <pagmo/problem.hpp>

#include "methods.h"
#include "sampling.h"
#include "semblance/core/errors.h"
#include "semblance/core/random.h"

namespace semblance {
namespace {

using Vectors = std::vector<Eigen::VectorXd>;
using pagmo::vector_double;

vector_double to_pagmo(const Eigen::VectorXd& y) { return {y.begin(), y.end()}; }

/// pagmo keeps to the box up to rounding only.
Eigen::VectorXd from_pagmo(const Search& search, const double* y) {
  return Eigen::Map<const Eigen::VectorXd>(y, search.size())
      .cwiseMax(search.lower())
      .cwiseMin(search.upper());
}

/// The seeds of pagmo are 32 bits wide.
unsigned pagmo_seed(const Search& search) {
  return static_cast<unsigned>(Random(search.options().seed).integer(1 << 30));
}

/// A search whose populations pagmo hands over as one batch.
struct BatchProblem {
  Search* search = nullptr;

  std::pair<vector_double, vector_double> get_bounds() const {
    return {to_pagmo(search->lower()), to_pagmo(search->upper())};
  }
  vector_double fitness(const vector_double& y) const { return batch_fitness(y); }
  vector_double batch_fitness(const vector_double& flat) const {
    const auto n = static_cast<std::size_t>(search->size());
    Vectors ys;
    for (std::size_t at = 0; at < flat.size(); at += n) {
      ys.push_back(from_pagmo(*search, flat.data() + at));
    }
    const std::vector<double> costs = search->evaluate(ys);
    if (ys.size() > 1) search->stop_if_collapsed(ys);
    return costs;
  }
};

class ParticleSwarm final : public SamplingOptimizer {
 public:
  explicit ParticleSwarm(const OptimizerOptions& options) : SamplingOptimizer(options) {}
  std::string name() const override { return "pso"; }

 private:
  void sample(Search& search) const override {
    Random random(search.options().seed, 1);
    Vectors ys{Eigen::VectorXd::Zero(search.size())};
    while (static_cast<int>(ys.size()) < search.options().population) {
      Eigen::VectorXd y(search.size());
      for (Eigen::Index i = 0; i < y.size(); ++i) {
        y[i] = random.uniform(search.lower()[i], search.upper()[i]);
      }
      ys.push_back(y);
    }
    const std::vector<double> costs = search.evaluate(ys);
    pagmo::population population(pagmo::problem(BatchProblem{&search}), 0, pagmo_seed(search));
    for (std::size_t i = 0; i < ys.size(); ++i) population.push_back(to_pagmo(ys[i]), {costs[i]});

    pagmo::pso_gen swarm(1000000);  // generations: the budget of evaluations ends it earlier
    swarm.set_seed(pagmo_seed(search));
    swarm.set_bfe(pagmo::bfe(pagmo::member_bfe()));
    swarm.evolve(population);
  }
};

/// What one generation of CMA-ES asked for, and what it shall be told.
struct Rehearsal {
  bool recording = true;
  Vectors ys;
  std::vector<double> costs;
  std::size_t next = 0;
};

/// pagmo's CMA-ES evaluates one point after the other. The points of a generation do not depend on
/// each other's costs, so a generation is first rehearsed on a copy, which only records the points;
/// they are evaluated as one batch, and the real generation is given their costs.
struct RehearsedProblem {
  const Search* search = nullptr;
  Rehearsal* rehearsal = nullptr;

  std::pair<vector_double, vector_double> get_bounds() const {
    return {to_pagmo(search->lower()), to_pagmo(search->upper())};
  }
  vector_double fitness(const vector_double& y) const {
    const Eigen::VectorXd point = from_pagmo(*search, y.data());
    if (rehearsal->recording) {
      rehearsal->ys.push_back(point);
      return {0.0};
    }
    if (rehearsal->next >= rehearsal->ys.size() || rehearsal->ys[rehearsal->next] != point) {
      throw SolverError("CMA-ES did not repeat the generation it had rehearsed");
    }
    return {rehearsal->costs[rehearsal->next++]};
  }
};

class CovarianceAdaptation final : public SamplingOptimizer {
 public:
  explicit CovarianceAdaptation(const OptimizerOptions& options) : SamplingOptimizer(options) {}
  std::string name() const override { return "cmaes"; }

 private:
  void sample(Search& search) const override {
    constexpr double start_deviation = 0.2;  // relative to the width of the box
    Rehearsal rehearsal;
    pagmo::population population(pagmo::problem(RehearsedProblem{&search, &rehearsal}), 0,
                                 pagmo_seed(search));
    const vector_double start(static_cast<std::size_t>(search.size()), 0.0);
    for (int i = 0; i < search.options().population; ++i) {
      population.push_back(start, {search.start_cost()});
    }
    const pagmo::cmaes method(1, -1, -1, -1, -1, start_deviation, 0.0, 0.0, true, true,
                              pagmo_seed(search));
    for (;;) {
      rehearsal = {};
      // On a copy: `evolve` is const but moves the method's inner state on.
      pagmo::cmaes(method).evolve(population);
      if (rehearsal.ys.empty()) throw Stop{Termination::converged, "CMA-ES found nothing to try"};
      rehearsal.costs = search.evaluate(rehearsal.ys);
      search.stop_if_collapsed(rehearsal.ys);
      rehearsal.recording = false;
      population = method.evolve(population);
    }
  }
};

}  // namespace

std::unique_ptr<Optimizer> make_pso(const OptimizerOptions& options) {
  return std::make_unique<ParticleSwarm>(options);
}

std::unique_ptr<Optimizer> make_cmaes(const OptimizerOptions& options) {
  return std::make_unique<CovarianceAdaptation>(options);
}

}  // namespace semblance
