// The smooth part of solutions on a grid.
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <array>
#include <span>
#include <vector>

#include "column_chunks.h"
#include "preconditioners.h"
#include "semblance/core/parallel.h"
#include "wide.h"

namespace semblance {
namespace {

constexpr int lines_per_cell = 8;
constexpr int reach = 2;  // coarse lines between nodes that one row of the matrix can link
constexpr int span = 2 * reach + 1;

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
  std::vector<int> begins_, rows_;  // the pattern that was analysed last
  bool solvable_ = false;
  Eigen::VectorXd solution_;
};

std::vector<CoarseGrid::Place> CoarseGrid::places(int lines) {
  const int cells = std::max(1, (lines - 1 + lines_per_cell - 1) / lines_per_cell);
  std::vector<Place> out(lines);
  for (int i = 0; i < lines; ++i) {
    const double at = static_cast<double>(i) * cells / std::max(1, lines - 1);
    const int cell = std::min(static_cast<int>(at), cells - 1);
    out[i] = {cell, at - cell};
  }
  return out;
}

CoarseGrid::CoarseGrid(const SheetGrid& grid)
    : grid_(grid),
      along_warp_(places(grid.columns)),
      along_weft_(places(grid.rows)),
      node_columns_(along_warp_.back().cell + 2),
      node_rows_(along_weft_.back().cell + 2) {}

CoarseGrid::Support CoarseGrid::support(int vertex) const {
  const Place& u = along_warp_[vertex % grid_.columns];
  const Place& v = along_weft_[vertex / grid_.columns];
  const double s = u.share, t = v.share;
  return {{node(u.cell, v.cell), node(u.cell + 1, v.cell), node(u.cell, v.cell + 1),
           node(u.cell + 1, v.cell + 1)},
          {(1.0 - s) * (1.0 - t), s * (1.0 - t), (1.0 - s) * t, s * t}};
}

CoarseGrid::Block CoarseGrid::symmetric(const Symmetric3& k, double scale) {
  Block block;
  block.column[0] = Column{k[0], k[1], k[2], 0.0} * scale;
  block.column[1] = Column{k[1], k[3], k[4], 0.0} * scale;
  block.column[2] = Column{k[2], k[4], k[5], 0.0} * scale;
  return block;
}

/// Nothing where the nodes are too far apart.
CoarseGrid::Block* CoarseGrid::near_block(int a, int b) {
  const int di = b % node_columns_ - a % node_columns_ + reach;
  const int dj = b / node_columns_ - a / node_columns_ + reach;
  if (di < 0 || di >= span || dj < 0 || dj >= span) return nullptr;
  return &near_[(static_cast<std::size_t>(a) * span + dj) * span + di];
}

/// Adds what the vertex's row holds to P' A P: first A P, then P'.
SEMBLANCE_WIDE void CoarseGrid::add_row(int vertex) {
  constexpr int window = 4;  // nodes of the vertex's cell and of the cells around it
  const int cell_i = along_warp_[vertex % grid_.columns].cell - 1;
  const int cell_j = along_weft_[vertex / grid_.columns].cell - 1;
  Block sums[window * window] = {};
  const BlockPattern& pattern = *matrix_->pattern;
  for (int k = pattern.begin[vertex]; k < pattern.begin[vertex + 1]; ++k) {
    const int c = pattern.column[k];
    if (is_fixed(c)) continue;
    Block block;
    if (c == vertex) {
      block = symmetric(matrix_->diagonal[vertex], 1.0);
    } else {
      for (int i = 0; i < 3; ++i) block.column[i] = load4(matrix_->blocks[k].data() + 4 * i);
    }
    const Support at = support(c);
    Block* sum = sums + (along_weft_[c / grid_.columns].cell - cell_j) * window +
                 along_warp_[c % grid_.columns].cell - cell_i;
    for (int i = 0; i < 3; ++i) {
      sum[0].column[i] += at.weight[0] * block.column[i];
      sum[1].column[i] += at.weight[1] * block.column[i];
      sum[window].column[i] += at.weight[2] * block.column[i];
      sum[window + 1].column[i] += at.weight[3] * block.column[i];
    }
  }
  const Support own = support(vertex);
  for (int a = 0; a < 4; ++a) {
    // The window starts one node before the vertex's cell, and the node's row two before the node.
    const int ai = a % 2, aj = a / 2;
    Block* to = near_.data() + static_cast<std::size_t>(own.node[a]) * span * span;
    for (int j = 0; j < window; ++j) {
      for (int i = 0; i < window; ++i) {
        Block& sum = to[(j - 1 - aj + reach) * span + i - 1 - ai + reach];
        for (int c = 0; c < 3; ++c) sum.column[c] += own.weight[a] * sums[j * window + i].column[c];
      }
    }
  }
}

/// What a link adds beyond its shares of the matrix's diagonal, which are there already.
void CoarseGrid::add_link(const Link& link) {
  constexpr int most_nodes = 16;
  int nodes[most_nodes], count = 0;
  double weight[4][most_nodes] = {};  // of each vertex at each node, times the link's
  for (int a = 0; a < 4 && link.vertex[a] >= 0; ++a) {
    const Support at = support(link.vertex[a]);
    for (int k = 0; k < 4; ++k) {
      const int n = static_cast<int>(std::find(nodes, nodes + count, at.node[k]) - nodes);
      if (n == count) nodes[count++] = at.node[k];
      weight[a][n] += link.weight[a] * at.weight[k];
    }
  }
  for (int n = 0; n < count; ++n) {
    for (int m = 0; m < count; ++m) {
      double scale = 0.0;
      for (int a = 0; a < 4; ++a) {
        for (int b = 0; b < 4; ++b) scale += a == b ? 0.0 : weight[a][n] * weight[b][m];
      }
      const Block block = symmetric(link.stiffness, scale);
      if (Block* near = near_block(nodes[n], nodes[m])) {
        for (int c = 0; c < 3; ++c) near->column[c] += block.column[c];
      } else {
        list_block(nodes[n], nodes[m], block);
      }
    }
  }
}

/// The lower half.
void CoarseGrid::list_block(int a, int b, const Block& block) {
  for (int j = 0; j < 3; ++j) {
    for (int i = 0; i < 3; ++i) {
      if (3 * a + i >= 3 * b + j) entries_.emplace_back(3 * a + i, 3 * b + j, block.column[j][i]);
    }
  }
}

void CoarseGrid::list_near() {
  for (int a = 0; a < node_count(); ++a) {
    const int ai = a % node_columns_, aj = a / node_columns_;
    for (int bj = std::max(0, aj - reach); bj <= aj; ++bj) {
      for (int bi = std::max(0, ai - reach); bi <= std::min(node_columns_ - 1, ai + reach); ++bi) {
        if (node(bi, bj) <= a) list_block(a, node(bi, bj), *near_block(a, node(bi, bj)));
      }
    }
  }
}

void CoarseGrid::prepare(const BlockMatrix& matrix) {
  matrix_ = &matrix;
  near_.assign(static_cast<std::size_t>(node_count()) * span * span, {});
  // Rows of cells write to the nodes on both of their sides: every other one at a time.
  std::vector<int> first_line(node_rows_, grid_.rows);
  for (int j = grid_.rows - 1; j >= 0; --j) first_line[along_weft_[j].cell] = j;
  const int strips = node_rows_ - 1;
  for (const int odd : {0, 1}) {
    parallel_for((strips + 1 - odd) / 2, [&](std::size_t k) {
      const int strip = 2 * static_cast<int>(k) + odd;
      for (int j = first_line[strip]; j < first_line[strip + 1]; ++j) {
        for (int i = 0; i < grid_.columns; ++i) {
          const int v = grid_.vertex(i, j);
          if (!is_fixed(v)) add_row(v);
        }
      }
    });
  }
  entries_.clear();
  for (const Link& link : matrix.links) add_link(link);
  list_near();
  Eigen::SparseMatrix<double> coarse(3 * node_count(), 3 * node_count());
  coarse.setFromTriplets(entries_.begin(), entries_.end());
  for (int k = 0; k < coarse.rows(); ++k) {
    if (coarse.coeff(k, k) == 0.0) coarse.coeffRef(k, k) = 1.0;  // all around is fixed
  }
  const std::span<const int> begins(coarse.outerIndexPtr(), coarse.outerSize() + 1);
  const std::span<const int> rows(coarse.innerIndexPtr(), coarse.nonZeros());
  if (!std::ranges::equal(begins, begins_) || !std::ranges::equal(rows, rows_)) {
    cholesky_.analyzePattern(coarse);
    begins_.assign(begins.begin(), begins.end());
    rows_.assign(rows.begin(), rows.end());
  }
  cholesky_.factorize(coarse);
  solvable_ = cholesky_.info() == Eigen::Success;
}

void CoarseGrid::solve(const BlockVector& r) {
  Eigen::VectorXd right = Eigen::VectorXd::Zero(3 * node_count());
  std::vector<Eigen::Vector4d> line(node_columns_);
  for (int j = 0; j < grid_.rows; ++j) {
    std::fill(line.begin(), line.end(), Eigen::Vector4d::Zero());
    for (int i = 0; i < grid_.columns; ++i) {
      const Place& u = along_warp_[i];
      const auto& here = r.col(grid_.vertex(i, j));
      line[u.cell] += (1.0 - u.share) * here;
      line[u.cell + 1] += u.share * here;
    }
    const Place& v = along_weft_[j];
    for (int i = 0; i < node_columns_; ++i) {
      right.segment<3>(3 * node(i, v.cell)) += (1.0 - v.share) * line[i].head<3>();
      right.segment<3>(3 * node(i, v.cell + 1)) += v.share * line[i].head<3>();
    }
  }
  if (solvable_) solution_ = cholesky_.solve(right);
}

void CoarseGrid::add_to(Eigen::Index first, Eigen::Index count, BlockVector& z) const {
  if (!solvable_) return;
  for (Eigen::Index k = first; k < first + count; ++k) {
    const int vertex = static_cast<int>(k);
    if (is_fixed(vertex)) continue;
    const Support at = support(vertex);
    for (int a = 0; a < 4; ++a)
      z.col(k).head<3>() += at.weight[a] * solution_.segment<3>(3 * at.node[a]);
  }
}

/// The sum of a preconditioner's solution and the coarse one: symmetric and positive as both are.
class TwoLevel : public Preconditioner {
 public:
  TwoLevel(std::unique_ptr<Preconditioner> fine, const SheetGrid& grid)
      : fine_(std::move(fine)), coarse_(grid) {}

  void prepare(const BlockMatrix& matrix) override {
    fine_->prepare(matrix);
    coarse_.prepare(matrix);
  }

  void apply(const BlockVector& r, BlockVector& z) override {
    parallel_for(2, [&](std::size_t k) { k == 0 ? coarse_.solve(r) : fine_->apply(r, z); });
    for_column_chunks(r.cols(), [&](std::size_t, Eigen::Index first, Eigen::Index n) {
      coarse_.add_to(first, n, z);
    });
  }

 private:
  std::unique_ptr<Preconditioner> fine_;
  CoarseGrid coarse_;
};

}  // namespace

std::unique_ptr<Preconditioner> make_two_level(std::unique_ptr<Preconditioner> fine,
                                               const SheetGrid& grid) {
  return std::make_unique<TwoLevel>(std::move(fine), grid);
}

}  // namespace semblance
