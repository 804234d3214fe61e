// The smooth part of a solution on a grid.
#pragma once

#include <Eigen/SparseCholesky>
#include <array>
#include <vector>

#include "semblance/cloth/block_matrix.h"
#include "semblance/cloth/sheet.h"
#include "wide.h"

namespace semblance {

/// What is left of a residual in functions that are bilinear over cells of some eight by eight
/// meshes of the sheet's grid, solved exactly: the coarse space of a two-level additive Schwarz
/// method (Toselli and Widlund 2005, section 3). Preconditioners that look along single lines pass
/// long waves on from line to line, one in every iteration; here they take one.
class CoarseGrid {
 public:
  explicit CoarseGrid(const SheetGrid& grid);

  /// Factors P' A P, with P the bilinear interpolation. Where that is not positive definite, which
  /// A is not either then, nothing is solved.
  void prepare(const BlockMatrix& matrix);
  /// Solves P' A P y = P' r.
  void solve(const BlockVector& r);
  /// Adds P y to columns first ... first + count - 1 of z.
  void add_to(Eigen::Index first, Eigen::Index count, BlockVector& z) const;

 private:
  // Aligned as every allocation is: the stack of code for older processors keeps no more.
  using Column = double __attribute__((vector_size(32), aligned(16)));
  struct Block {
    Column column[3];
  };
  /// A line of the sheet lies `share` of the way from coarse line `cell` to the next.
  struct Place {
    int cell;
    double share;
  };
  /// Coarse nodes around a vertex, and the values of their functions there.
  struct Support {
    std::array<int, 4> node;
    std::array<double, 4> weight;
  };
  using Cholesky = Eigen::SimplicialLLT<Eigen::SparseMatrix<double>, Eigen::Lower>;

  static std::vector<Place> places(int lines);
  static Block symmetric(const Symmetric3& k, double scale);
  int node(int i, int j) const { return j * node_columns_ + i; }
  int node_count() const { return node_columns_ * node_rows_; }
  bool is_fixed(int v) const { return !matrix_->fixed.empty() && matrix_->fixed[v]; }
  Support support(int vertex) const;
  Block* near_block(int a, int b);
  void add_row(int vertex);
  void add_link(const Link& link);
  void list_near();
  void list_block(int a, int b, const Block& block);

  SheetGrid grid_;
  std::vector<Place> along_warp_, along_weft_;  // of columns and of rows
  int node_columns_, node_rows_;
  const BlockMatrix* matrix_ = nullptr;
  std::vector<Block> near_;  // of each node and those up to two lines away
  std::vector<Eigen::Triplet<double>> entries_;
  Cholesky cholesky_;
  bool solvable_ = false;
  Eigen::VectorXd solution_;
};

}  // namespace semblance
