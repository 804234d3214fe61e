#include "semblance/core/random.h"

#include <cmath>
#include <string>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

// The finaliser of SplitMix64 (Steele, Lea and Flood 2014): a bijection, so the streams of one seed
// all start differently.
std::uint64_t mix(std::uint64_t value) {
  value = (value ^ (value >> 30)) * 0xbf58476d1ce4e5b9ULL;
  value = (value ^ (value >> 27)) * 0x94d049bb133111ebULL;
  return value ^ (value >> 31);
}

}  // namespace

Random::Random(std::uint64_t seed, std::uint64_t stream)
    : engine_(mix(mix(seed + 0x9e3779b97f4a7c15ULL) + stream)) {}

// The distributions of <random> differ between standard libraries, so they are written out here.
double Random::uniform() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }

double Random::uniform(double lower, double upper) {
  const double value = lower + (upper - lower) * uniform();
  return value < upper ? value : lower;  // rounding may reach the upper end
}

double Random::normal() {
  if (spare_normal_) {
    const double value = *spare_normal_;
    spare_normal_.reset();
    return value;
  }
  // The polar method (Marsaglia and Bray 1964) gives two at a time.
  double x = 0.0, y = 0.0, squared = 0.0;
  do {
    x = 2.0 * uniform() - 1.0;
    y = 2.0 * uniform() - 1.0;
    squared = x * x + y * y;
  } while (squared >= 1.0 || squared == 0.0);
  const double scale = std::sqrt(-2.0 * std::log(squared) / squared);
  spare_normal_ = y * scale;
  return x * scale;
}

int Random::integer(int count) {
  if (count <= 0) {
    throw InvalidInput("Random::integer: the count must be positive, not " + std::to_string(count));
  }
  return static_cast<int>(uniform() * count);
}

Eigen::VectorXd Random::normal_vector(Eigen::Index size) {
  Eigen::VectorXd values(size);
  for (double& value : values) value = normal();
  return values;
}

}  // namespace semblance
