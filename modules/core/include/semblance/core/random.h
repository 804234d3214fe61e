// Seeded random numbers that are the same on every platform and for every number of threads.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <random>

namespace semblance {

/// One stream of random numbers. Streams made from the same seed with different `stream` numbers
/// are independent, so work item i takes Random(seed, i) and the result does not depend on which
/// thread ran it.
class Random {
 public:
  explicit Random(std::uint64_t seed, std::uint64_t stream = 0);

  double uniform();                            // [0, 1)
  double uniform(double lower, double upper);  // [lower, upper)
  double normal();                             // mean 0, deviation 1
  int integer(int count);                      // 0 .. count-1
  Eigen::VectorXd normal_vector(Eigen::Index size);

 private:
  std::mt19937_64 engine_;
  std::optional<double> spare_normal_;
};

}  // namespace semblance
