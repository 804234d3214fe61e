// Simulated annealing over continuous parameters.
//
// Moves change one direction at a time and their length follows the share of accepted moves, as in
// Corana, Marchesi, Martini and Ridella 1987 (ACM TOMS 13(3)). A few chains run side by side at the
// same temperature so that a batch fills several threads; after each round the worst one restarts
// from the best point known (synchronous Markov chains, Lee and Lee 1996, IEEE TPDS 7(10)).
#include <algorithm>
#include <array>
#include <cmath>

#include "methods.h"
#include "sampling.h"
#include "semblance/core/random.h"

namespace semblance {
namespace {

constexpr int chain_count = 4;       // fixed: the result must not depend on the number of threads
constexpr int sweeps_per_round = 2;  // moves of each chain in each direction between adaptations
constexpr double start_acceptance = 0.5;
constexpr double end_temperature_ratio =
    1e-6;  // lengths shrink a thousandfold, costs by its square

struct Chain {
  Random random;
  Eigen::VectorXd y;
  double cost;
};

/// The temperature at which a typical uphill move of the given lengths is taken half the time.
double start_temperature(Search& search, const Eigen::VectorXd& length, Random& random) {
  std::vector<Eigen::VectorXd> probes;
  for (Eigen::Index i = 0; i < search.size(); ++i) {
    Eigen::VectorXd y = Eigen::VectorXd::Zero(search.size());
    y[i] = random.uniform(-length[i], length[i]);
    probes.push_back(search.reflect(y));
  }
  std::vector<double> rises;
  for (const double cost : search.evaluate(probes)) {
    const double rise = std::abs(cost - search.start_cost());
    if (std::isfinite(rise)) rises.push_back(rise);
  }
  if (rises.empty()) return 1.0;
  std::nth_element(rises.begin(), rises.begin() + rises.size() / 2, rises.end());
  return std::max(rises[rises.size() / 2], 1e-300) / -std::log(start_acceptance);
}

/// Corana et al., section 3: longer when more than 60 % were accepted, shorter below 40 %.
double adapted_length(double length, double accepted_share) {
  constexpr double strength = 2.0;
  if (accepted_share > 0.6) return length * (1.0 + strength * (accepted_share - 0.6) / 0.4);
  if (accepted_share < 0.4) return length / (1.0 + strength * (0.4 - accepted_share) / 0.4);
  return length;
}

class Anneal final : public SamplingOptimizer {
 public:
  explicit Anneal(const OptimizerOptions& options) : SamplingOptimizer(options) {}
  std::string name() const override { return "anneal"; }

 private:
  void sample(Search& search) const override;
};

/// One move of every chain in direction i; returns how many were accepted.
int move(Search& search, std::vector<Chain>& chains, Eigen::Index i, double length,
         double temperature) {
  std::vector<Eigen::VectorXd> trials;
  for (Chain& chain : chains) {
    Eigen::VectorXd y = chain.y;
    y[i] += chain.random.uniform(-length, length);
    trials.push_back(search.reflect(std::move(y)));
  }
  const std::vector<double> costs = search.evaluate(trials);
  int accepted = 0;
  for (std::size_t c = 0; c < chains.size(); ++c) {
    const double chance = chains[c].random.uniform();
    if (!(costs[c] <= chains[c].cost ||
          chance < std::exp(-(costs[c] - chains[c].cost) / temperature))) {
      continue;
    }
    chains[c].y = trials[c];
    chains[c].cost = costs[c];
    ++accepted;
  }
  return accepted;
}

void Anneal::sample(Search& search) const {
  const Eigen::Index n = search.size();
  Random random(search.options().seed, chain_count);
  const Eigen::VectorXd width = search.upper() - search.lower();
  Eigen::VectorXd length = 0.5 * width;
  const double hottest = start_temperature(search, length, random);

  std::vector<Chain> chains;
  for (int c = 0; c < chain_count; ++c) {
    chains.push_back(
        {Random(search.options().seed, c), Eigen::VectorXd::Zero(n), search.start_cost()});
  }
  Chain best = chains.front();
  for (;;) {
    Eigen::VectorXi accepted = Eigen::VectorXi::Zero(n);
    for (int sweep = 0; sweep < sweeps_per_round; ++sweep) {
      for (Eigen::Index i = 0; i < n; ++i) {
        const double temperature = hottest * std::pow(end_temperature_ratio, search.used());
        accepted[i] += move(search, chains, i, length[i], temperature);
        for (const Chain& chain : chains) {
          if (chain.cost < best.cost) best = chain;
        }
      }
    }
    constexpr double moves = chain_count * sweeps_per_round;
    for (Eigen::Index i = 0; i < n; ++i) {
      length[i] = std::min(adapted_length(length[i], accepted[i] / moves), width[i]);
    }
    if (length.maxCoeff() <= search.tolerance()) {
      throw Stop{Termination::converged, "the moves are below the step tolerance"};
    }
    const auto worst =
        std::max_element(chains.begin(), chains.end(),
                         [](const Chain& a, const Chain& b) { return a.cost < b.cost; });
    worst->y = best.y;
    worst->cost = best.cost;
  }
}

}  // namespace

std::unique_ptr<Optimizer> make_anneal(const OptimizerOptions& options) {
  return std::make_unique<Anneal>(options);
}

}  // namespace semblance
