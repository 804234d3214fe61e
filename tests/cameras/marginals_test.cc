#include "marginals.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

namespace semblance {
namespace {

// Blocks of 3, 2 | 2, 4, 1 columns: the last three are coupled to the first two alone.
const std::vector<BlockColumns> blocks{{0, 3}, {3, 2}, {5, 2}, {7, 4}, {11, 1}};
constexpr std::size_t kept = 2;

Eigen::MatrixXd arrow_matrix() {
  Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(60, 12);
  std::srand(5);
  for (int row = 0; row < 60; ++row) {
    jacobian.row(row).head(5).setRandom();
    const BlockColumns& own = blocks[kept + static_cast<std::size_t>(row % 3)];
    jacobian.row(row).segment(own.first, own.size).setRandom();
  }
  return jacobian.transpose() * jacobian;
}

TEST(Marginals, AreTheBlocksOfTheInverse) {
  const Eigen::MatrixXd normal = arrow_matrix(), inverse = normal.inverse();
  const Marginals found = marginal_inverse(normal.sparseView(), blocks, kept);
  ASSERT_EQ(found.loose, -1);
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    const auto [first, size] = blocks[i];
    EXPECT_LT((found.blocks[i] - inverse.block(first, first, size, size)).norm(),
              1e-12 * inverse.norm());
  }
}

TEST(Marginals, NameTheLooseBlock) {
  Eigen::MatrixXd normal = arrow_matrix();
  normal.row(4).setZero();
  normal.col(4).setZero();
  EXPECT_EQ(marginal_inverse(normal.sparseView(), blocks, kept).loose, 1);
  normal = arrow_matrix();
  normal.row(8).setZero();
  normal.col(8).setZero();
  EXPECT_EQ(marginal_inverse(normal.sparseView(), blocks, kept).loose, 3);
}

}  // namespace
}  // namespace semblance
