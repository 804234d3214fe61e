#include "clip_covariance.h"

#include <Eigen/Cholesky>

namespace semblance {
namespace {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

/// The blocks of the inverse that belong to the next two nodes and the shared entries.
struct Window {
  Matrix next, second_next, second, shared_next, shared_second, shared;
};

Matrix stack(const Matrix& a, const Matrix& b, const Matrix& c) {
  Matrix all(a.rows() + b.rows() + c.rows(), a.cols());
  all << a, b, c;
  return all;
}

Matrix symmetric(const Window& z) {
  const Eigen::Index n = z.next.rows(), s = z.shared.rows();
  Matrix all(2 * n + s, 2 * n + s);
  all << z.next, z.second_next.transpose(), z.shared_next.transpose(), z.second_next, z.second,
      z.shared_second.transpose(), z.shared_next, z.shared_second, z.shared;
  return all;
}

}  // namespace

/// Eliminates the nodes in order, then recovers the diagonal of the inverse backwards: with B the
/// unknowns after node k and U = A_Bk A_kk^-1, Z_Bk = -Z_BB U and Z_kk = A_kk^-1 + U' Z_BB U.
/// Chains end by themselves, because the blocks that would couple them are zero.
ClipVariances clip_variances(std::vector<ClipColumn> columns, Matrix shared) {
  const std::size_t count = columns.size();
  const Eigen::Index n = columns.front().diagonal.rows(), s = shared.rows();
  std::vector<Matrix> regression(count), inverse(count);
  for (std::size_t k = 0; k < count; ++k) {
    ClipColumn& column = columns[k];
    inverse[k] = column.diagonal.llt().solve(Matrix::Identity(n, n));
    const Matrix below = stack(column.next, column.second, column.shared);
    regression[k] = below * inverse[k];
    const Matrix update = regression[k] * below.transpose();
    if (k + 1 < count) {
      columns[k + 1].diagonal -= update.topLeftCorner(n, n);
      columns[k + 1].next -= update.block(n, 0, n, n);
      columns[k + 1].shared -= update.block(2 * n, 0, s, n);
    }
    if (k + 2 < count) {
      columns[k + 2].diagonal -= update.block(n, n, n, n);
      columns[k + 2].shared -= update.block(2 * n, n, s, n);
    }
    shared -= update.bottomRightCorner(s, s);
  }

  Window z{Matrix::Zero(n, n), Matrix::Zero(n, n),
           Matrix::Zero(n, n), Matrix::Zero(s, n),
           Matrix::Zero(s, n), s > 0 ? Matrix(shared.llt().solve(Matrix::Identity(s, s))) : shared};
  ClipVariances variances{std::vector<Vector>(count), z.shared.diagonal()};
  for (std::size_t k = count; k-- > 0;) {
    const Matrix off = -symmetric(z) * regression[k];
    const Matrix own = inverse[k] - regression[k].transpose() * off;
    variances.own[k] = own.diagonal();
    z = {own, off.topRows(n), z.next, off.bottomRows(s), z.shared_next, z.shared};
  }
  return variances;
}

}  // namespace semblance
