// Variances of a clip's unknowns: the diagonal of the inverse of its Hessian.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace semblance {

/// A column of blocks of the clip's Hessian from the diagonal down: the node itself, the next two
/// nodes, the entries that all nodes share.
struct ClipColumn {
  Eigen::MatrixXd diagonal, next, second;  // n x n; only the blocks below the diagonal are kept
  Eigen::MatrixXd shared;                  // s x n
};

struct ClipVariances {
  std::vector<Eigen::VectorXd> own;  // n entries per node
  Eigen::VectorXd shared;            // s entries
};

/// Diagonal of the inverse of the symmetric positive definite matrix that has these columns and, in
/// the lower right corner, `shared` (s x s, s may be 0). There is at least one node. The cost grows
/// with the number of nodes, not with its cube: block elimination and its reversal (Takahashi,
/// Fagan and Chin 1973).
ClipVariances clip_variances(std::vector<ClipColumn> columns, Eigen::MatrixXd shared);

}  // namespace semblance
