// Symmetric sparse matrices of 3x3 blocks: second derivatives in the vertices' positions.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

namespace semblance {

/// Three coordinates and a padding per vertex: what solvers work on.
using BlockVector = Eigen::Matrix<double, 4, Eigen::Dynamic>;

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

/// Symmetric part of a block: xx, xy, xz, yy, yz, zz.
using Symmetric3 = std::array<double, 6>;

/// The stiffness K of a relative motion r = sum_i weight[i] x[vertex[i]], as of a contact: its
/// energy is r' K r / 2. Vertices end at the first -1.
struct Link {
  std::array<int, 4> vertex;
  std::array<double, 4> weight;
  Symmetric3 stiffness;
};

/// The Hessian of an energy that does not change when everything moves together, plus a block
/// `own` on each diagonal, plus links:
///     (A x)_i = sum_{j != i} A_ij (x_j - x_i) + own_i x_i + sum_links weight_i K r.
/// In this form blocks may be rounded to single precision, which halves the traffic: stiffness of
/// thousands still cancels exactly in motions that stretch nothing, and leaves the weak stiffness
/// against bending and shear. Contacts may be stiffer than that by many orders, and would leave
/// negative stiffness behind if they were summed up in blocks at all, so they stay as they are.
///
/// Blocks are by columns, padded to four rows; those of the diagonal are unused. `diagonal` holds
/// what everything sums up to there, for preconditioners, in double precision, so that factoring
/// finds the weak stiffness too.
struct BlockMatrix {
  const BlockPattern* pattern = nullptr;
  std::vector<std::array<float, 12>> blocks;
  std::vector<Symmetric3> own;
  std::vector<Symmetric3> diagonal;
  std::vector<bool> fixed;  // rows of the identity, or empty; x must be zero there
  std::vector<Link> links;  // without weight on fixed vertices
  std::vector<std::vector<int>> links_of_chunk;

  /// Adds a link; K is symmetric and not negative. Before complete().
  void add(const std::array<int, 4>& vertex, const std::array<double, 4>& weight,
           const Eigen::Matrix3d& stiffness);

  /// Sets `diagonal` and `links_of_chunk`. Before multiply and solvers.
  void complete();
  /// y = A x, on several threads.
  void multiply(const BlockVector& x, BlockVector& y) const;

 private:
  void list_links();
};

}  // namespace semblance
