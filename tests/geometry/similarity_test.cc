#include "semblance/geometry/similarity.h"

#include <gtest/gtest.h>

#include "semblance/core/errors.h"
#include "semblance/core/random.h"

namespace semblance {
namespace {

Eigen::Matrix2Xd random_points(Random& random, int count) {
  Eigen::Matrix2Xd points(2, count);
  for (int i = 0; i < count; ++i) points.col(i) << random.normal(), random.normal();
  return points;
}

TEST(Similarity, IsEigensUmeyama) {
  Random random(5);
  for (int trial = 0; trial < 30; ++trial) {
    const Eigen::MatrixXd from = random_points(random, 7);
    const Eigen::Affine2d truth = Eigen::Translation2d(3.0, -8.0) *
                                  Eigen::Rotation2Dd(random.uniform(-3.0, 3.0)) *
                                  Eigen::Scaling(random.uniform(0.2, 5.0));
    const Eigen::MatrixXd to = (truth * Eigen::Matrix2Xd(from)) + 0.2 * random_points(random, 7);
    for (const bool scale : {true, false}) {
      const Eigen::MatrixXd expected = Eigen::umeyama(from, to, scale);
      EXPECT_LT((fit_similarity(from, to, scale).matrix() - expected).cwiseAbs().maxCoeff(), 1e-9);
    }
  }
}

TEST(Similarity, RefusesPointsThatFixNone) {
  const Eigen::Matrix2Xd three = Eigen::Matrix2Xd::Ones(2, 3);
  EXPECT_THROW(fit_similarity(three, three), InvalidInput);
  EXPECT_THROW(fit_similarity(three, three.leftCols(2)), InvalidInput);
  EXPECT_THROW(fit_similarity(three.leftCols(1), three.leftCols(1)), InvalidInput);
}

}  // namespace
}  // namespace semblance
