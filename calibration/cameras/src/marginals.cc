#include "marginals.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <optional>

namespace semblance {
namespace {

using Eigen::MatrixXd;
using Sparse = Eigen::SparseMatrix<double>;

// Below this share of the largest eigenvalue of the scaled matrix nothing is known.
constexpr double kSingular = 1e-13;

// The rows above `limit` that couple to a block.
std::vector<int> coupled_rows(const Sparse& normal, const BlockColumns& block, int limit) {
  std::vector<int> rows;
  for (int column = block.first; column < block.first + block.size; ++column) {
    for (Sparse::InnerIterator it(normal, column); it && it.row() < limit; ++it) {
      rows.push_back(static_cast<int>(it.row()));
    }
  }
  std::sort(rows.begin(), rows.end());
  rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
  return rows;
}

// An eliminated block: what couples it to the kept ones, and the inverse of its own part.
struct Eliminated {
  std::vector<int> rows;
  MatrixXd coupling, inverse;
};

// The inverse, or else the index of a parameter along which the matrix is singular.
struct Inverse {
  MatrixXd matrix;
  int loose = -1;
};

Inverse invert(const MatrixXd& matrix) {
  const Eigen::Index size = matrix.rows();
  if (size == 0) return {};
  for (Eigen::Index i = 0; i < size; ++i) {
    if (!(matrix(i, i) > 0.0)) return {{}, static_cast<int>(i)};
  }
  const Eigen::VectorXd scale = matrix.diagonal().cwiseSqrt().cwiseInverse();
  const MatrixXd scaled = scale.asDiagonal() * matrix * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(scaled);
  const Eigen::VectorXd& values = eigen.eigenvalues();
  if (eigen.info() != Eigen::Success || !(values[0] > kSingular * values[size - 1])) {
    Eigen::Index loose = 0;
    eigen.eigenvectors().col(0).cwiseAbs().maxCoeff(&loose);
    return {{}, static_cast<int>(loose)};
  }
  const MatrixXd root =
      scale.asDiagonal() * eigen.eigenvectors() * values.cwiseSqrt().cwiseInverse().asDiagonal();
  return {root * root.transpose(), -1};
}

int block_of(const std::vector<BlockColumns>& blocks, int column) {
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    if (column < blocks[i].first + blocks[i].size) return static_cast<int>(i);
  }
  return -1;
}

std::optional<Eliminated> eliminate(const Sparse& normal, const BlockColumns& block, int limit) {
  const Inverse own =
      invert(MatrixXd(normal.block(block.first, block.first, block.size, block.size)));
  if (own.loose >= 0) return std::nullopt;
  Eliminated result{coupled_rows(normal, block, limit), {}, own.matrix};
  const MatrixXd columns = MatrixXd(normal.block(0, block.first, limit, block.size));
  result.coupling = columns(result.rows, Eigen::all);
  return result;
}

}  // namespace

Marginals marginal_inverse(const Sparse& normal, const std::vector<BlockColumns>& blocks,
                           std::size_t kept) {
  const int limit = kept < blocks.size() ? blocks[kept].first : static_cast<int>(normal.cols());
  MatrixXd reduced = MatrixXd(normal.topLeftCorner(limit, limit));
  std::vector<Eliminated> eliminated;
  for (std::size_t i = kept; i < blocks.size(); ++i) {
    std::optional<Eliminated> part = eliminate(normal, blocks[i], limit);
    if (!part) return {{}, static_cast<int>(i)};
    reduced(part->rows, part->rows) -= part->coupling * part->inverse * part->coupling.transpose();
    eliminated.push_back(std::move(*part));
  }
  const Inverse sigma = invert(reduced);
  if (sigma.loose >= 0) return {{}, block_of(blocks, sigma.loose)};

  Marginals result;
  for (std::size_t i = 0; i < kept; ++i) {
    result.blocks.push_back(
        sigma.matrix.block(blocks[i].first, blocks[i].first, blocks[i].size, blocks[i].size));
  }
  for (const Eliminated& part : eliminated) {
    const MatrixXd pull = part.inverse * part.coupling.transpose();
    const MatrixXd of_kept = sigma.matrix(part.rows, part.rows);
    result.blocks.push_back(part.inverse + pull * of_kept * pull.transpose());
  }
  return result;
}

}  // namespace semblance
