// Exact solves along a grid's warp lines and weft lines, in turn: symmetric Gauss-Seidel by lines.
//
// Cloth is stiff along its yarns and weak in shear, so almost all of the matrix's stiffness, and
// all of its bending but twist, lies in coupling along single lines. There it is block pentadiagonal
// and is factored as L D L' without fill. Lines couple to the next two on either side, so every third
// line may be solved at a time.
#include <algorithm>
#include <array>

#include <Eigen/LU>

#include "preconditioners.h"
#include "semblance/core/parallel.h"

namespace semblance {
namespace {

constexpr int lanes = 8;
constexpr int colours = 3;
using Lane = double __attribute__((vector_size(8 * lanes)));
using Block = std::array<Lane, 9>;  // by columns

/// c -= a b'.
void subtract_outer(const Block& a, const Block& b, Block& c) {
  for (int col = 0; col < 3; ++col) {
    for (int row = 0; row < 3; ++row) {
      for (int k = 0; k < 3; ++k) c[3 * col + row] -= a[3 * k + row] * b[3 * k + col];
    }
  }
}

Block multiply(const Block& a, const Block& b) {
  Block c{};
  for (int col = 0; col < 3; ++col) {
    for (int row = 0; row < 3; ++row) {
      for (int k = 0; k < 3; ++k) c[3 * col + row] += a[3 * k + row] * b[3 * col + k];
    }
  }
  return c;
}

/// Of a symmetric block.
Block inverse(const Block& m) {
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
void subtract_product(const Block& a, const std::array<Lane, 3>& x, std::array<Lane, 3>& y) {
  for (int row = 0; row < 3; ++row) y[row] -= a[row] * x[0] + a[3 + row] * x[1] + a[6 + row] * x[2];
}

/// y -= a' x.
void subtract_transposed(const Block& a, const std::array<Lane, 3>& x, std::array<Lane, 3>& y) {
  for (int row = 0; row < 3; ++row) {
    y[row] -= a[3 * row] * x[0] + a[3 * row + 1] * x[1] + a[3 * row + 2] * x[2];
  }
}

/// All lines of one direction: `length` places each, `lanes` lines of one colour side by side.
class LineSolver {
 public:
  LineSolver(const SheetGrid& grid, bool along_warp)
      : grid_(grid),
        along_warp_(along_warp),
        length_(along_warp ? grid.columns : grid.rows),
        count_(along_warp ? grid.rows : grid.columns) {
    factors_.resize(static_cast<std::size_t>(colours) * packs_per_colour() * length_);
  }

  void prepare(const BlockMatrix& matrix) {
    if (place_.empty()) find_places(matrix);
    matrix_ = &matrix;
    parallel_for(colours * packs_per_colour(),
                 [&](std::size_t pack) { factor(static_cast<int>(pack)); });
  }

  /// Adds to z what the lines of a colour need to meet r, with all others held.
  void correct(int colour, const BlockVector& r, BlockVector& z) const {
    parallel_for(packs_per_colour(), [&](std::size_t k) {
      solve(colour * packs_per_colour() + static_cast<int>(k), r, z);
    });
  }

 private:
  struct Factor {
    Block inverse_pivot, one_back, two_back;  // D^-1 and L's blocks in this row
  };

  int lines_per_colour() const { return (count_ + colours - 1) / colours; }
  int packs_per_colour() const { return (lines_per_colour() + lanes - 1) / lanes; }

  /// The line in a lane of a pack, or -1 for an idle lane.
  int line(int pack, int lane) const {
    const int within = pack % packs_per_colour() * lanes + lane;
    const int out = within * colours + pack / packs_per_colour();
    return within < lines_per_colour() && out < count_ ? out : -1;
  }

  int vertex(int line, int place) const {
    return along_warp_ ? grid_.vertex(place, line) : grid_.vertex(line, place);
  }

  /// Indices of the blocks one and two back, or -1, so that preparing does not search. Fixed
  /// vertices are cut off from their lines.
  void find_places(const BlockMatrix& matrix) {
    const auto find = [&](int a, int b) {
      if (!matrix.fixed.empty() && (matrix.fixed[a] || matrix.fixed[b])) return -1;
      return matrix.pattern->find(a, b);
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

  void load(int pack, int i, int back, Block& out) const {
    for (int lane = 0; lane < lanes; ++lane) {
      const int at = line(pack, lane);
      const int k = at < 0 ? -1 : place_[static_cast<std::size_t>(at) * length_ + i][back - 1];
      for (int c = 0; c < 3; ++c) {
        for (int r = 0; r < 3; ++r) {
          out[3 * c + r][lane] = k < 0 ? 0.0 : matrix_->blocks[k][4 * c + r];
        }
      }
    }
  }

  void load_diagonal(int pack, int i, Block& out) const {
    constexpr std::array<int, 9> place{0, 1, 2, 1, 3, 4, 2, 4, 5};
    constexpr std::array<double, 6> idle{1, 0, 0, 1, 0, 1};
    for (int lane = 0; lane < lanes; ++lane) {
      const int at = line(pack, lane);
      const auto& d = at < 0 ? idle : matrix_->diagonal[vertex(at, i)];
      for (int k = 0; k < 9; ++k) out[k][lane] = d[place[k]];
    }
  }

  void factor(int pack) {
    Factor* rows = factors_.data() + static_cast<std::size_t>(pack) * length_;
    Block pivot[2] = {}, one_back = {};  // inverse pivots one and two back, L one row up
    for (int i = 0; i < length_; ++i) {
      Block diagonal, one, two;
      load_diagonal(pack, i, diagonal);
      load(pack, i, 1, one);
      load(pack, i, 2, two);
      // A(i, i-1) loses L(i, i-2) D(i-2) L(i-1, i-2)', and L(i, i-2) D(i-2) is A(i, i-2).
      const Block two_back = multiply(two, pivot[1]);
      subtract_outer(two, one_back, one);
      subtract_outer(two_back, two, diagonal);
      one_back = multiply(one, pivot[0]);
      subtract_outer(one_back, one, diagonal);
      pivot[1] = pivot[0];
      pivot[0] = inverse(diagonal);
      rows[i] = {pivot[0], one_back, two_back};
    }
  }

  void solve(int pack, const BlockVector& r, BlockVector& z) const {
    using Vector = std::array<Lane, 3>;
    const Factor* rows = factors_.data() + static_cast<std::size_t>(pack) * length_;
    std::vector<Vector> y(length_, Vector{});
    for (int i = 0; i < length_; ++i) {
      for (int lane = 0; lane < lanes; ++lane) {
        const int at = line(pack, lane);
        if (at < 0) continue;
        const int v = vertex(at, i);
        const Eigen::Vector4d residual = r.col(v) - matrix_->row_product(z, v);
        for (int c = 0; c < 3; ++c) y[i][c][lane] = residual[c];
      }
      if (i > 0) subtract_product(rows[i].one_back, y[i - 1], y[i]);
      if (i > 1) subtract_product(rows[i].two_back, y[i - 2], y[i]);
    }
    for (int i = length_ - 1; i >= 0; --i) {
      Vector scaled{};
      subtract_product(rows[i].inverse_pivot, y[i], scaled);
      for (int c = 0; c < 3; ++c) y[i][c] = -scaled[c];
      if (i + 1 < length_) subtract_transposed(rows[i + 1].one_back, y[i + 1], y[i]);
      if (i + 2 < length_) subtract_transposed(rows[i + 2].two_back, y[i + 2], y[i]);
    }
    for (int i = 0; i < length_; ++i) {
      for (int lane = 0; lane < lanes; ++lane) {
        const int at = line(pack, lane);
        if (at < 0) continue;
        double* out = z.data() + 4 * static_cast<std::ptrdiff_t>(vertex(at, i));
        for (int c = 0; c < 3; ++c) out[c] += y[i][c][lane];
      }
    }
  }

  SheetGrid grid_;
  bool along_warp_;
  int length_, count_;
  const BlockMatrix* matrix_ = nullptr;
  std::vector<std::array<int, 2>> place_;
  std::vector<Factor> factors_;
};

/// Warp lines forwards, weft lines there and back, warp lines backwards: symmetric, and positive
/// whatever the coupling across lines.
class Lines : public Preconditioner {
 public:
  explicit Lines(const SheetGrid& grid) : warp_(grid, true), weft_(grid, false) {}

  void prepare(const BlockMatrix& matrix) override {
    warp_.prepare(matrix);
    weft_.prepare(matrix);
  }

  void apply(const BlockVector& r, BlockVector& z) override {
    z.setZero(4, r.cols());
    for (int c = 0; c < colours; ++c) warp_.correct(c, r, z);
    for (int c = 0; c < colours; ++c) weft_.correct(c, r, z);
    for (int c = colours - 2; c >= 0; --c) weft_.correct(c, r, z);
    for (int c = colours - 1; c >= 0; --c) warp_.correct(c, r, z);
  }

 private:
  LineSolver warp_, weft_;
};

}  // namespace

std::unique_ptr<Preconditioner> make_lines(const SheetGrid& grid) {
  return std::make_unique<Lines>(grid);
}

}  // namespace semblance
