#include "semblance/core/random.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

TEST(Random, SameSeedAndStreamGiveTheSameNumbers) {
  Random a(5, 2), b(5, 2), other_stream(5, 3), other_seed(6, 2);
  int same_stream = 0, same_seed = 0;
  for (int i = 0; i < 100; ++i) {
    const double value = a.uniform();
    EXPECT_EQ(value, b.uniform());
    same_stream += value == other_stream.uniform();
    same_seed += value == other_seed.uniform();
  }
  EXPECT_EQ(same_stream, 0);
  EXPECT_EQ(same_seed, 0);
}

TEST(Random, StreamsAreUncorrelated) {
  // The first number of each stream: as a sequence over streams it must look uniform as well.
  double sum = 0.0, sum_squared = 0.0, lagged = 0.0, previous = 0.0;
  const int count = 20000;
  for (int stream = 0; stream < count; ++stream) {
    const double value = Random(1, stream).uniform() - 0.5;
    sum += value;
    sum_squared += value * value;
    lagged += value * previous;
    previous = value;
  }
  const double sigma = 1.0 / std::sqrt(12.0 * count);  // of the mean
  EXPECT_LT(std::abs(sum / count), 4.0 * sigma);
  EXPECT_NEAR(sum_squared / count, 1.0 / 12.0, 4.0 * std::sqrt(1.0 / 180.0 / count));
  EXPECT_LT(std::abs(lagged / count), 4.0 / 12.0 / std::sqrt(count));
}

TEST(Random, UniformStaysInItsInterval) {
  Random random(9);
  for (int i = 0; i < 10000; ++i) {
    const double value = random.uniform(-2.0, 3.0);
    ASSERT_GE(value, -2.0);
    ASSERT_LT(value, 3.0);
  }
}

TEST(Random, NormalHasTheMomentsAndTailsOfTheNormalDistribution) {
  const Eigen::VectorXd values = Random(4).normal_vector(200000);
  const double root_count = std::sqrt(200000.0);
  EXPECT_LT(std::abs(values.mean()), 4.0 / root_count);
  EXPECT_NEAR(values.squaredNorm() / 200000.0, 1.0, 4.0 * std::sqrt(2.0) / root_count);
  EXPECT_NEAR(values.array().pow(4).mean(), 3.0, 4.0 * std::sqrt(96.0) / root_count);
  const double beyond = (values.array().abs() > 1.959963985).cast<double>().mean();
  EXPECT_NEAR(beyond, 0.05, 4.0 * std::sqrt(0.05 * 0.95) / root_count);
}

TEST(Random, IntegersAreEquallyLikely) {
  Random random(11);
  std::array<int, 7> counts{};
  for (int i = 0; i < 70000; ++i) ++counts.at(random.integer(7));
  double chi_squared = 0.0;
  for (const int count : counts) chi_squared += (count - 10000.0) * (count - 10000.0) / 10000.0;
  EXPECT_LT(chi_squared, 22.46);  // 6 degrees of freedom, one in a thousand
  EXPECT_EQ(random.integer(1), 0);
  EXPECT_THROW(random.integer(0), InvalidInput);
}

}  // namespace
}  // namespace semblance
