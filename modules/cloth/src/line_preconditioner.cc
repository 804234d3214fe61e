// Exact solves along a grid's warp lines and along its weft lines, added up.
//
// Cloth is stiff along its yarns and weak in shear, so almost all of the matrix's stiffness, and
// all of its bending but twist, lies in coupling along single lines. There it is block
// pentadiagonal and is factored as L D L' without fill. Factors are found in double precision, so
// that the weak stiffness is not lost, and kept in single precision, which halves the traffic.
#include <algorithm>
#include <array>

#include "column_chunks.h"
#include "preconditioners.h"
#include "semblance/core/parallel.h"
#include "wide.h"

namespace semblance {
namespace {

constexpr int lanes = 8;  // lines side by side
// Aligned as every allocation is: the stack of code for older processors keeps no more.
using Lane = double __attribute__((vector_size(8 * lanes), aligned(16)));
using FloatLane = float __attribute__((vector_size(4 * lanes), aligned(16)));
struct InDouble {  // attributes get lost on the way through template arguments
  using Type = Lane;
};
struct InSingle {
  using Type = FloatLane;
};
template <class Precision, int count>
struct Lanes {
  using Type = typename Precision::Type;
  Type lane[count];
  Type& operator[](int k) { return lane[k]; }
  const Type& operator[](int k) const { return lane[k]; }
};
using Block = Lanes<InDouble, 9>;  // by columns
using FloatBlock = Lanes<InSingle, 9>;
using FloatVector = Lanes<InSingle, 3>;

/// c -= a b'.
[[gnu::always_inline]] inline void subtract_outer(const Block& a, const Block& b, Block& c) {
  for (int col = 0; col < 3; ++col) {
    for (int row = 0; row < 3; ++row) {
      for (int k = 0; k < 3; ++k) c[3 * col + row] -= a[3 * k + row] * b[3 * k + col];
    }
  }
}

[[gnu::always_inline]] inline Block multiply(const Block& a, const Block& b) {
  Block c{};
  for (int col = 0; col < 3; ++col) {
    for (int row = 0; row < 3; ++row) {
      for (int k = 0; k < 3; ++k) c[3 * col + row] += a[3 * k + row] * b[3 * col + k];
    }
  }
  return c;
}

/// Of a symmetric block.
[[gnu::always_inline]] inline Block inverse(const Block& m) {
  const Lane c00 = m[4] * m[8] - m[7] * m[7], c01 = m[6] * m[7] - m[3] * m[8],
             c02 = m[3] * m[7] - m[6] * m[4];
  const Lane scale = 1.0 / (m[0] * c00 + m[3] * c01 + m[6] * c02);
  Block out;
  out[0] = c00 * scale;
  out[1] = out[3] = c01 * scale;
  out[2] = out[6] = c02 * scale;
  out[4] = (m[0] * m[8] - m[6] * m[6]) * scale;
  out[5] = out[7] = (m[3] * m[6] - m[0] * m[7]) * scale;
  out[8] = (m[0] * m[4] - m[3] * m[3]) * scale;
  return out;
}

/// y -= a x.
[[gnu::always_inline]] inline void subtract_product(const FloatBlock& a, const FloatVector& x,
                                                    FloatVector& y) {
  for (int row = 0; row < 3; ++row) y[row] -= a[row] * x[0] + a[3 + row] * x[1] + a[6 + row] * x[2];
}

/// y -= a' x.
[[gnu::always_inline]] inline void subtract_transposed(const FloatBlock& a, const FloatVector& x,
                                                       FloatVector& y) {
  for (int row = 0; row < 3; ++row) {
    y[row] -= a[3 * row] * x[0] + a[3 * row + 1] * x[1] + a[3 * row + 2] * x[2];
  }
}

/// D^-1 and L's blocks in one row.
template <class Type>
struct Factor {
  Type inverse_pivot, one_back, two_back;
};
using DoubleFactor = Factor<Block>;
using FloatFactor = Factor<FloatBlock>;

/// Solves along lines side by side, in place.
SEMBLANCE_WIDE void solve_lines(const FloatFactor* rows, int length, FloatVector* y) {
  for (int i = 0; i < length; ++i) {
    if (i > 0) subtract_product(rows[i].one_back, y[i - 1], y[i]);
    if (i > 1) subtract_product(rows[i].two_back, y[i - 2], y[i]);
  }
  for (int i = length - 1; i >= 0; --i) {
    FloatVector scaled{};
    subtract_product(rows[i].inverse_pivot, y[i], scaled);
    for (int c = 0; c < 3; ++c) y[i][c] = -scaled[c];
    if (i + 1 < length) subtract_transposed(rows[i + 1].one_back, y[i + 1], y[i]);
    if (i + 2 < length) subtract_transposed(rows[i + 2].two_back, y[i + 2], y[i]);
  }
}

/// One row of the factorisation: blocks are A's on entry, D^-1 and L's on return. `pivot` and
/// `one_up` are the inverse pivots one and two rows back and L's block one row up.
SEMBLANCE_WIDE void factor_row(DoubleFactor& row, Block (&pivot)[2], Block& one_up) {
  // A(i, i-1) loses L(i, i-2) D(i-2) L(i-1, i-2)', and L(i, i-2) D(i-2) is A(i, i-2).
  const Block two = row.two_back;
  row.two_back = multiply(two, pivot[1]);
  Block one = row.one_back, diagonal = row.inverse_pivot;
  subtract_outer(two, one_up, one);
  subtract_outer(row.two_back, two, diagonal);
  row.one_back = multiply(one, pivot[0]);
  subtract_outer(row.one_back, one, diagonal);
  row.inverse_pivot = inverse(diagonal);
  pivot[1] = pivot[0];
  pivot[0] = row.inverse_pivot;
  one_up = row.one_back;
}

FloatBlock rounded(const Block& block) {
  FloatBlock out;
  for (int k = 0; k < 9; ++k) out[k] = __builtin_convertvector(block[k], FloatLane);
  return out;
}

/// All lines of one direction: `length` places each, `lanes` lines side by side in a pack.
class LineSolver {
 public:
  LineSolver(const SheetGrid& grid, bool along_warp)
      : grid_(grid),
        along_warp_(along_warp),
        length_(along_warp ? grid.columns : grid.rows),
        count_(along_warp ? grid.rows : grid.columns) {
    factors_.resize(static_cast<std::size_t>(packs()) * length_);
  }

  int packs() const { return (count_ + lanes - 1) / lanes; }

  void attach(const BlockMatrix& matrix) {
    matrix_ = &matrix;
    if (place_.empty()) find_places();
    linked_.resize(place_.size());
    for (const std::size_t row : linked_rows_) linked_[row] = {};
    linked_rows_.clear();
    for (const Link& link : matrix.links) {
      for (int a = 0; a < 4 && link.vertex[a] >= 0; ++a) {
        for (int b = 0; b < a; ++b) note_link(link, a, b);
      }
    }
  }

  void factor(int pack) {
    FloatFactor* rows = factors_.data() + static_cast<std::size_t>(pack) * length_;
    DoubleFactor row;
    Block pivot[2] = {}, one_up = {};
    for (int i = 0; i < length_; ++i) {
      load_diagonal(pack, i, row.inverse_pivot);
      load(pack, i, 1, row.one_back);
      load(pack, i, 2, row.two_back);
      factor_row(row, pivot, one_up);
      rows[i] = {rounded(row.inverse_pivot), rounded(row.one_back), rounded(row.two_back)};
    }
  }

  /// Sets z on a pack's lines to what solves them for r.
  void solve(int pack, const BlockVector& r, Eigen::Matrix4Xf& z) const {
    thread_local std::vector<FloatVector> y;
    y.resize(length_);
    const int used = std::min(lanes, count_ - pack * lanes);
    for (int i = 0; i < length_; ++i) {
      y[i] = {};
      for (int lane = 0; lane < used; ++lane) {
        const int v = vertex(pack * lanes + lane, i);
        for (int c = 0; c < 3; ++c) y[i][c][lane] = static_cast<float>(r(c, v));
      }
    }
    solve_lines(factors_.data() + static_cast<std::size_t>(pack) * length_, length_, y.data());
    for (int i = 0; i < length_; ++i) {
      for (int lane = 0; lane < used; ++lane) {
        const int v = vertex(pack * lanes + lane, i);
        for (int c = 0; c < 3; ++c) z(c, v) = y[i][c][lane];
      }
    }
  }

 private:
  int vertex(int line, int place) const {
    return along_warp_ ? grid_.vertex(place, line) : grid_.vertex(line, place);
  }

  std::pair<int, int> line_and_place(int v) const {
    const int column = v % grid_.columns, row = v / grid_.columns;
    return along_warp_ ? std::pair{row, column} : std::pair{column, row};
  }

  /// Indices of the blocks one and two back, or -1, so that preparing does not search. Fixed
  /// vertices are cut off from their lines.
  void find_places() {
    const auto find = [&](int a, int b) {
      if (!matrix_->fixed.empty() && (matrix_->fixed[a] || matrix_->fixed[b])) return -1;
      return matrix_->pattern->find(a, b);
    };
    place_.resize(static_cast<std::size_t>(count_) * length_);
    for (int at = 0; at < count_; ++at) {
      for (int i = 0; i < length_; ++i) {
        const int v = vertex(at, i);
        place_[static_cast<std::size_t>(at) * length_ + i] = {
            i > 0 ? find(v, vertex(at, i - 1)) : -1, i > 1 ? find(v, vertex(at, i - 2)) : -1};
      }
    }
  }

  /// Links between vertices of one line, one or two places apart.
  void note_link(const Link& link, int a, int b) {
    const auto [line_a, i_a] = line_and_place(link.vertex[a]);
    const auto [line_b, i_b] = line_and_place(link.vertex[b]);
    const int back = std::abs(i_a - i_b);
    if (line_a != line_b || back < 1 || back > 2) return;
    const std::size_t row = static_cast<std::size_t>(line_a) * length_ + std::max(i_a, i_b);
    linked_rows_.push_back(row);
    Symmetric3& sum = linked_[row][back - 1];
    const double scale = link.weight[a] * link.weight[b];
    for (int k = 0; k < 6; ++k) sum[k] += scale * link.stiffness[k];
  }

  void load(int pack, int i, int back, Block& out) const {
    constexpr std::array<int, 9> place{0, 1, 2, 1, 3, 4, 2, 4, 5};
    for (int lane = 0; lane < lanes; ++lane) {
      const int at = pack * lanes + lane;
      const std::size_t row = static_cast<std::size_t>(at) * length_ + i;
      const int k = at < count_ ? place_[row][back - 1] : -1;
      for (int c = 0; c < 9; ++c) {
        out[c][lane] =
            k < 0 ? 0.0
                  : matrix_->blocks[k][4 * (c / 3) + c % 3] + linked_[row][back - 1][place[c]];
      }
    }
  }

  void load_diagonal(int pack, int i, Block& out) const {
    constexpr std::array<int, 9> place{0, 1, 2, 1, 3, 4, 2, 4, 5};
    constexpr std::array<double, 6> idle{1, 0, 0, 1, 0, 1};
    for (int lane = 0; lane < lanes; ++lane) {
      const int at = pack * lanes + lane;
      const auto& d = at < count_ ? matrix_->diagonal[vertex(at, i)] : idle;
      for (int k = 0; k < 9; ++k) out[k][lane] = d[place[k]];
    }
  }

  SheetGrid grid_;
  bool along_warp_;
  int length_, count_;
  const BlockMatrix* matrix_ = nullptr;
  std::vector<std::array<int, 2>> place_;
  std::vector<std::array<Symmetric3, 2>> linked_;  // what links add to those blocks
  std::vector<std::size_t> linked_rows_;           // where that is not zero
  std::vector<FloatFactor> factors_;
};

/// The sum of both directions' solutions: symmetric and positive as each of them is.
class Lines : public Preconditioner {
 public:
  explicit Lines(const SheetGrid& grid) : warp_(grid, true), weft_(grid, false) {}

  void prepare(const BlockMatrix& matrix) override {
    warp_.attach(matrix);
    weft_.attach(matrix);
    each_pack([](LineSolver& lines, int pack, Eigen::Matrix4Xf&) { lines.factor(pack); });
  }

  void apply(const BlockVector& r, BlockVector& z) override {
    for (Eigen::Matrix4Xf* part : {&along_warp_, &along_weft_}) {
      if (part->cols() != r.cols()) part->setZero(4, r.cols());
    }
    each_pack(
        [&](LineSolver& lines, int pack, Eigen::Matrix4Xf& part) { lines.solve(pack, r, part); });
    z.resize(4, r.cols());
    for_column_chunks(r.cols(), [&](std::size_t, Eigen::Index first, Eigen::Index n) {
      z.middleCols(first, n) =
          (along_warp_.middleCols(first, n) + along_weft_.middleCols(first, n)).cast<double>();
    });
  }

 private:
  template <class Body>
  void each_pack(const Body& body) {
    const int first = warp_.packs();
    parallel_for(first + weft_.packs(), [&](std::size_t k) {
      const int pack = static_cast<int>(k);
      pack < first ? body(warp_, pack, along_warp_) : body(weft_, pack - first, along_weft_);
    });
  }

  LineSolver warp_, weft_;
  Eigen::Matrix4Xf along_warp_, along_weft_;
};

}  // namespace

std::unique_ptr<Preconditioner> make_lines(const SheetGrid& grid) {
  return std::make_unique<Lines>(grid);
}

}  // namespace semblance
