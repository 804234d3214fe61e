// Symmetric sparse matrices of 3x3 blocks: second derivatives in the vertices' positions.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

namespace semblance {

/// One float vector of three coordinates and a padding per vertex: what solvers work on.
using BlockVector = Eigen::Matrix<float, 4, Eigen::Dynamic>;

/// Which blocks may differ from zero. Rows are sorted, and hold both halves and the diagonal.
struct BlockPattern {
  std::vector<int> begin{0};
  std::vector<int> column;
  std::vector<int> diagonal;  // index of each row's diagonal block
  std::vector<int> mirror;    // index of the transposed block

  int row_count() const { return static_cast<int>(begin.size()) - 1; }
  int block_count() const { return static_cast<int>(column.size()); }
  /// Index of block (row, column), or -1.
  int find(int row, int column) const;
};

/// From the neighbours of each row (any order, repeated or not; made symmetric here).
BlockPattern make_pattern(std::vector<std::vector<int>> neighbours);

/// A relative motion r = sum_k weight[k] x[vertex[k]] with its own stiffness: what a contact adds
/// outside the pattern. Unused vertices are -1.
struct Coupling {
  std::array<int, 4> vertex;
  std::array<float, 4> weight;
  std::array<float, 6> stiffness;  // xx, xy, xz, yy, yz, zz
};

/// Blocks by columns, padded to four rows. The couplings are part of the matrix: their diagonal
/// blocks are in `blocks` already, their mixed ones only here.
struct BlockMatrix {
  const BlockPattern* pattern = nullptr;
  std::vector<std::array<float, 12>> blocks;
  std::vector<Coupling> couplings;

  /// y = A x, on several threads.
  void multiply(const BlockVector& x, BlockVector& y) const;
};

}  // namespace semblance
