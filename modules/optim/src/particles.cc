// Annealed sets of particles: each layer weighs, selects and moves a whole population.
//
// `interacting`: interacting simulated annealing, Gall, Potthoff, Schnoerr, Rosenhahn and Brox 2007
// (J. Math. Imaging and Vision 28): a particle survives with a probability given by its own weight,
// else it is replaced by a weighted draw; moves follow the covariance of the survivors.
// `particle`: annealed particle filter, Deutscher and Reid 2005 (IJCV 61(2)): the sharpness of
// each layer is chosen so that a set share of the particles survives, then the set is resampled
// and diffused by the spread of each direction.
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "methods.h"
#include "sampling.h"
#include "semblance/core/random.h"

namespace semblance {
namespace {

using Particles = std::vector<Eigen::VectorXd>;

/// exp(-sharpness * cost), relative to the best; zero where the cost is infinite.
Eigen::VectorXd boltzmann_weights(const std::vector<double>& costs, double sharpness) {
  const double least = *std::min_element(costs.begin(), costs.end());
  Eigen::VectorXd weights(costs.size());
  for (std::size_t i = 0; i < costs.size(); ++i) {
    weights[i] = std::isfinite(costs[i]) ? std::exp(-sharpness * (costs[i] - least)) : 0.0;
  }
  if (!(weights.sum() > 0.0)) weights.setOnes();  // nothing can be evaluated: keep wandering
  return weights;
}

/// Mean of costs - min over the particles that could be evaluated, never zero.
double mean_excess(const std::vector<double>& costs) {
  const double least = *std::min_element(costs.begin(), costs.end());
  double sum = 0.0;
  int count = 0;
  for (const double cost : costs) {
    if (!std::isfinite(cost)) continue;
    sum += cost - least;
    ++count;
  }
  return std::max(sum / std::max(count, 1), 1e-300);
}

/// Index drawn with the given (unnormalised) weights.
std::size_t draw(const Eigen::VectorXd& weights, Random& random) {
  double left = random.uniform() * weights.sum();
  for (Eigen::Index i = 0; i + 1 < weights.size(); ++i) {
    left -= weights[i];
    if (left < 0.0) return static_cast<std::size_t>(i);
  }
  return static_cast<std::size_t>(weights.size() - 1);
}

Eigen::MatrixXd covariance_of(const Particles& particles) {
  const Eigen::Index n = particles.front().size();
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(n);
  for (const Eigen::VectorXd& y : particles) mean += y / static_cast<double>(particles.size());
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(n, n);
  for (const Eigen::VectorXd& y : particles) sum += (y - mean) * (y - mean).transpose();
  return sum / static_cast<double>(particles.size() - 1);
}

/// The start and normally distributed particles around it.
Particles first_set(const Search& search, Random& random) {
  constexpr double deviation = 0.5;
  Particles particles{Eigen::VectorXd::Zero(search.size())};
  while (static_cast<int>(particles.size()) < search.options().population) {
    particles.push_back(search.reflect(deviation * random.normal_vector(search.size())));
  }
  return particles;
}

class Interacting final : public SamplingOptimizer {
 public:
  explicit Interacting(const OptimizerOptions& options) : SamplingOptimizer(options) {}
  std::string name() const override { return "interacting"; }

 private:
  void sample(Search& search) const override;
};

void Interacting::sample(Search& search) const {
  constexpr double spread = 0.4, least_deviation = 1e-7, end_temperature_ratio = 1e-8;
  Random random(search.options().seed);
  Particles particles = first_set(search, random);
  double hottest = 0.0;
  for (;;) {
    const std::vector<double> costs = search.evaluate(particles);
    search.stop_if_collapsed(particles);
    if (hottest == 0.0) hottest = mean_excess(costs);
    // Their geometric schedule: the set keeps the spread that belongs to the temperature.
    const double temperature = hottest * std::pow(end_temperature_ratio, search.used());
    const Eigen::VectorXd weights = boltzmann_weights(costs, 1.0 / temperature);

    Particles survivors;
    for (std::size_t i = 0; i < particles.size(); ++i) {
      const bool survives = random.uniform() < weights[i] / weights.maxCoeff();
      survivors.push_back(particles[survives ? i : draw(weights, random)]);
    }
    // Fewer particles than directions leave the covariance singular: half of it is its diagonal.
    Eigen::MatrixXd covariance = covariance_of(survivors);
    covariance = 0.5 * covariance + 0.5 * Eigen::MatrixXd(covariance.diagonal().asDiagonal());
    covariance.diagonal().array() += least_deviation * least_deviation;
    const Eigen::MatrixXd factor = (spread * covariance).llt().matrixL();
    for (Eigen::VectorXd& y : survivors) {
      y = search.reflect(y + factor * random.normal_vector(y.size()));
    }
    particles = std::move(survivors);
  }
}

class AnnealedParticleFilter final : public SamplingOptimizer {
 public:
  explicit AnnealedParticleFilter(const OptimizerOptions& options) : SamplingOptimizer(options) {}
  std::string name() const override { return "particle"; }

 private:
  void sample(Search& search) const override;
};

/// Sharpness at which the effective number of particles (Deutscher and Reid 2005, equation 12) is
/// the given share of those that can be evaluated.
double sharpness_for_survival(const std::vector<double>& costs, double share) {
  const auto finite =
      std::count_if(costs.begin(), costs.end(), [](double cost) { return std::isfinite(cost); });
  double low = 0.0, high = 1e6 / mean_excess(costs);
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    const Eigen::VectorXd weights = boltzmann_weights(costs, middle);
    const double effective = weights.sum() * weights.sum() / weights.squaredNorm();
    (effective > share * static_cast<double>(finite) ? low : high) = middle;
  }
  return low;
}

void AnnealedParticleFilter::sample(Search& search) const {
  constexpr double survival = 0.5, start_deviation = 0.5, end_deviation = 1e-4;
  Random random(search.options().seed);
  Particles particles = first_set(search, random);
  for (;;) {
    const std::vector<double> costs = search.evaluate(particles);
    search.stop_if_collapsed(particles);
    const Eigen::VectorXd weights =
        boltzmann_weights(costs, sharpness_for_survival(costs, survival));
    const double deviation =
        start_deviation * std::pow(end_deviation / start_deviation, search.used());
    const Eigen::VectorXd spread = covariance_of(particles).diagonal().cwiseSqrt();
    Particles next;
    for (std::size_t i = 0; i < particles.size(); ++i) {
      const Eigen::VectorXd noise =
          spread.cwiseMin(deviation).cwiseProduct(random.normal_vector(spread.size()));
      next.push_back(search.reflect(particles[draw(weights, random)] + noise));
    }
    particles = std::move(next);
  }
}

}  // namespace

std::unique_ptr<Optimizer> make_interacting(const OptimizerOptions& options) {
  return std::make_unique<Interacting>(options);
}

std::unique_ptr<Optimizer> make_particle(const OptimizerOptions& options) {
  return std::make_unique<AnnealedParticleFilter>(options);
}

}  // namespace semblance
