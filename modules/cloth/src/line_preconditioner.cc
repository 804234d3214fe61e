// Exact solves along a grid's warp lines and weft lines, in turn: symmetric Gauss-Seidel by lines.
//
// Cloth is stiff along its yarns and weak in shear, so almost all of the matrix's stiffness, and
// all of its bending but twist, lies in coupling along single lines. There it is block
// pentadiagonal and is factored as L D L' without fill. Lines couple to the next two on either
// side, so every third line may be solved at a time.
#include <algorithm>
#include <array>

#include <Eigen/LU>

#include "preconditioners.h"
#include "row_product.h"
#include "semblance/core/parallel.h"

namespace semblance {
namespace {

constexpr int lanes = 8;
constexpr int colours = 3;
constexpr int chunk_slots = 1024;
// Aligned as every allocation is: the stack of code for older processors keeps no more.
using Lane = double __attribute__((vector_size(8 * lanes), aligned(16)));
template <int count>
struct Lanes {
  Lane lane[count];
  Lane& operator[](int k) { return lane[k]; }
  const Lane& operator[](int k) const { return lane[k]; }
};
using LaneVector = Lanes<3>;
using Block = Lanes<9>;  // by columns

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
[[gnu::always_inline]] inline void subtract_product(const Block& a, const LaneVector& x,
                                                    LaneVector& y) {
  for (int row = 0; row < 3; ++row) y[row] -= a[row] * x[0] + a[3 + row] * x[1] + a[6 + row] * x[2];
}

/// y -= a' x.
[[gnu::always_inline]] inline void subtract_transposed(const Block& a, const LaneVector& x,
                                                       LaneVector& y) {
  for (int row = 0; row < 3; ++row) {
    y[row] -= a[3 * row] * x[0] + a[3 * row + 1] * x[1] + a[3 * row + 2] * x[2];
  }
}

struct Factor {
  Block inverse_pivot, one_back, two_back;  // D^-1 and L's blocks in one row
};

/// A vertex, and where its first coordinate is among the lanes; the others follow `lanes` apart.
struct Slot {
  int vertex;
  int target;
};

/// What the vertices of some slots still miss, into the lanes. In the order of vertices, so that
/// the matrix streams.
SEMBLANCE_WIDE void gather_residuals(const BlockMatrix& a, const Slot* slots, int count,
                                     const double* r, const double* z, double* y) {
  const int* begin = a.pattern->begin.data();
  const int* column = a.pattern->column.data();
  for (int k = 0; k < count; ++k) {
    // Every third row of the matrix: the processor does not guess that.
    const int ahead = slots[std::min(k + 3, count - 1)].vertex;
    const char* next = reinterpret_cast<const char*>(a.blocks[begin[ahead]].data());
    const char* end = reinterpret_cast<const char*>(a.blocks[begin[ahead + 1] - 1].data());
    for (; next < end; next += 64) __builtin_prefetch(next);
    const int v = slots[k].vertex;
    const Double4 d =
        load4(r + 4 * static_cast<std::ptrdiff_t>(v)) - row_product(a, begin, column, z, v);
    for (int c = 0; c < 3; ++c) y[slots[k].target + c * lanes] = d[c];
  }
}

/// Solves along lines side by side, in place.
SEMBLANCE_WIDE void solve_lines(const Factor* rows, int length, LaneVector* y) {
  for (int i = 0; i < length; ++i) {
    if (i > 0) subtract_product(rows[i].one_back, y[i - 1], y[i]);
    if (i > 1) subtract_product(rows[i].two_back, y[i - 2], y[i]);
  }
  for (int i = length - 1; i >= 0; --i) {
    LaneVector scaled{};
    subtract_product(rows[i].inverse_pivot, y[i], scaled);
    for (int c = 0; c < 3; ++c) y[i][c] = -scaled[c];
    if (i + 1 < length) subtract_transposed(rows[i + 1].one_back, y[i + 1], y[i]);
    if (i + 2 < length) subtract_transposed(rows[i + 2].two_back, y[i + 2], y[i]);
  }
}

/// One row of the factorisation: blocks are A's on entry, D^-1 and L's on return. `pivot` and
/// `one_up` are the inverse pivots one and two rows back and L's block one row up.
SEMBLANCE_WIDE void factor_row(Factor& row, Block (&pivot)[2], Block& one_up) {
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

/// All lines of one direction: `length` places each, `lanes` lines of one colour side by side.
class LineSolver {
 public:
  LineSolver(const SheetGrid& grid, bool along_warp)
      : grid_(grid),
        along_warp_(along_warp),
        length_(along_warp ? grid.columns : grid.rows),
        count_(along_warp ? grid.rows : grid.columns) {
    factors_.resize(static_cast<std::size_t>(colours) * packs_per_colour() * length_);
    lanes_.resize(static_cast<std::size_t>(packs_per_colour()) * length_);
  }

  void prepare(const BlockMatrix& matrix) {
    if (place_.empty()) {
      find_places(matrix);
      find_slots(matrix);
    }
    matrix_ = &matrix;
    parallel_for(colours * packs_per_colour(),
                 [&](std::size_t pack) { factor(static_cast<int>(pack)); });
  }

  /// Adds to z what the lines of a colour need to meet r, with all others held.
  void correct(int colour, const BlockVector& r, BlockVector& z) {
    const std::vector<Slot>& slots = slots_[colour];
    double* y = reinterpret_cast<double*>(lanes_.data());
    const int count = static_cast<int>(slots.size()),
              chunks = (count + chunk_slots - 1) / chunk_slots;
    parallel_for(chunks, [&](std::size_t c) {
      const int first = static_cast<int>(c) * chunk_slots;
      gather_residuals(*matrix_, slots.data() + first, std::min(chunk_slots, count - first),
                       r.data(), z.data(), y);
    });
    const auto solve = [&](std::size_t k) {
      const std::size_t pack = colour * packs_per_colour() + k;
      solve_lines(factors_.data() + pack * length_, length_, lanes_.data() + k * length_);
    };
    // Below one chunk waking other threads takes longer than the work.
    if (chunks == 1) {
      for (int k = 0; k < packs_per_colour(); ++k) solve(k);
    } else {
      parallel_for(packs_per_colour(), solve);
    }
    parallel_for(chunks, [&](std::size_t c) {
      const int end = std::min(count, (static_cast<int>(c) + 1) * chunk_slots);
      for (int k = static_cast<int>(c) * chunk_slots; k < end; ++k) {
        for (int i = 0; i < 3; ++i) z(i, slots[k].vertex) += y[slots[k].target + i * lanes];
      }
    });
  }

 private:
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

  void find_slots(const BlockMatrix& matrix) {
    for (int pack = 0; pack < colours * packs_per_colour(); ++pack) {
      for (int i = 0; i < length_; ++i) {
        for (int lane = 0; lane < lanes; ++lane) {
          const int at = line(pack, lane);
          if (at < 0 || (!matrix.fixed.empty() && matrix.fixed[vertex(at, i)])) continue;
          const int place = pack % packs_per_colour() * length_ + i;
          slots_[pack / packs_per_colour()].push_back({vertex(at, i), 3 * lanes * place + lane});
        }
      }
    }
    for (std::vector<Slot>& slots : slots_) {
      std::sort(slots.begin(), slots.end(),
                [](const Slot& a, const Slot& b) { return a.vertex < b.vertex; });
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
    Block pivot[2] = {}, one_up = {};
    for (int i = 0; i < length_; ++i) {
      load_diagonal(pack, i, rows[i].inverse_pivot);
      load(pack, i, 1, rows[i].one_back);
      load(pack, i, 2, rows[i].two_back);
      factor_row(rows[i], pivot, one_up);
    }
  }

  SheetGrid grid_;
  bool along_warp_;
  int length_, count_;
  const BlockMatrix* matrix_ = nullptr;
  std::vector<std::array<int, 2>> place_;
  std::vector<Factor> factors_;
  std::array<std::vector<Slot>, colours> slots_;
  std::vector<LaneVector> lanes_;  // of one colour; zero in idle lanes
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
