// Blocks of the inverse of a large normal matrix.
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <vector>

namespace semblance {

/// The columns [first, first + size) of one parameter block.
struct BlockColumns {
  int first = 0, size = 0;
};

struct Marginals {
  std::vector<Eigen::MatrixXd> blocks;  // diagonal blocks of the inverse
  int loose = -1;  // where the matrix is singular: a block along which it is; `blocks` is empty
};

/// The diagonal blocks of the inverse of a symmetric matrix. From block `kept` on, the blocks are
/// coupled to the first `kept` alone and are eliminated one by one (Schur complement).
Marginals marginal_inverse(const Eigen::SparseMatrix<double>& normal,
                           const std::vector<BlockColumns>& blocks, std::size_t kept);

}  // namespace semblance
