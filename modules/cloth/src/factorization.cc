// The sparse Cholesky factorisation of a sheet's matrix, by MUMPS (multifrontal, nested
// dissection).
#include <dmumps_c.h>
#include <fmt/format.h>

#include "preconditioners.h"
#include "semblance/core/errors.h"

// OpenBLAS sums in an order that depends on its threads; other BLAS have none.
extern "C" void openblas_set_num_threads(int) __attribute__((weak));

namespace semblance {
namespace {

constexpr int sequential = -987654;  // MUMPS's communicator for one process
constexpr int positive_definite = 1, metis = 5;
enum Job { begin = -1, finish = -2, analyse = 1, factor = 2, substitute = 3 };

class Factorization : public Preconditioner {
 public:
  Factorization() {
    if (openblas_set_num_threads != nullptr) openblas_set_num_threads(1);
    mumps_.par = 1;
    mumps_.sym = positive_definite;
    mumps_.comm_fortran = sequential;
    run(begin);
    for (const int stream : {0, 1, 2}) mumps_.icntl[stream] = -1;
    mumps_.icntl[3] = 0;  // says nothing
    mumps_.icntl[6] = metis;
  }
  ~Factorization() override {
    mumps_.job = finish;
    dmumps_c(&mumps_);
  }
  Factorization(const Factorization&) = delete;

  void prepare(const BlockMatrix& matrix) override {
    list_entries(matrix);
    const bool same_places = row_ == analysed_row_ && column_ == analysed_column_;
    if (!same_places) {
      mumps_.n = 3 * matrix.pattern->row_count();
      mumps_.nnz = static_cast<MUMPS_INT8>(row_.size());
      mumps_.irn = row_.data();
      mumps_.jcn = column_.data();
      run(analyse);
      analysed_row_ = row_;
      analysed_column_ = column_;
    }
    mumps_.irn = row_.data();
    mumps_.jcn = column_.data();
    mumps_.a = value_.data();
    run(factor);
  }

  void apply(const BlockVector& r, BlockVector& z) override {
    const Eigen::Index n = r.cols();
    packed_ = r.topRows<3>();
    mumps_.rhs = packed_.data();
    mumps_.nrhs = 1;
    mumps_.lrhs = static_cast<MUMPS_INT>(3 * n);
    run(substitute);
    z.resize(4, n);
    z.topRows<3>() = packed_;
    z.row(3).setZero();
  }

 private:
  void run(Job job) {
    mumps_.job = job;
    dmumps_c(&mumps_);
    // Less workspace than needed: its estimate grows by a given part.
    while (mumps_.infog[0] == -9 && mumps_.icntl[13] < 1000) {
      mumps_.icntl[13] = 2 * mumps_.icntl[13] + 20;
      dmumps_c(&mumps_);
    }
    if (mumps_.infog[0] >= 0) return;
    throw SolverError(fmt::format("cloth: the factorisation of {} equations failed (MUMPS {}, {})",
                                  mumps_.n, mumps_.infog[0], mumps_.infog[1]));
  }

  void add(int row, int column, double value) {
    row_.push_back(row + 1);
    column_.push_back(column + 1);
    value_.push_back(value);
  }

  /// The lower half.
  void list_entries(const BlockMatrix& matrix) {
    row_.clear(), column_.clear(), value_.clear();
    constexpr int place[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
    const BlockPattern& pattern = *matrix.pattern;
    const auto is_free = [&](int v) { return matrix.fixed.empty() || !matrix.fixed[v]; };
    for (int r = 0; r < pattern.row_count(); ++r) {
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j <= i; ++j) add(3 * r + i, 3 * r + j, matrix.diagonal[r][place[i][j]]);
      }
      for (int k = pattern.begin[r]; k < pattern.begin[r + 1]; ++k) {
        const int c = pattern.column[k];
        if (c >= r || !is_free(r) || !is_free(c)) continue;
        for (int j = 0; j < 3; ++j) {
          for (int i = 0; i < 3; ++i) add(3 * r + i, 3 * c + j, matrix.blocks[k][4 * j + i]);
        }
      }
    }
    // Links' shares of the diagonal are there already. Entries at the same place are summed up.
    for (const Link& link : matrix.links) {
      for (int a = 1; a < 4 && link.vertex[a] >= 0; ++a) {
        for (int b = 0; b < a; ++b) {
          const double scale = link.weight[a] * link.weight[b];
          if (scale == 0.0) continue;
          for (int j = 0; j < 3; ++j) {
            for (int i = 0; i < 3; ++i) {
              add(3 * link.vertex[a] + i, 3 * link.vertex[b] + j,
                  scale * link.stiffness[place[i][j]]);
            }
          }
        }
      }
    }
  }

  DMUMPS_STRUC_C mumps_{};
  std::vector<MUMPS_INT> row_, column_, analysed_row_, analysed_column_;
  std::vector<double> value_;
  Eigen::Matrix<double, 3, Eigen::Dynamic> packed_;
};

}  // namespace

std::unique_ptr<Preconditioner> make_factorization() { return std::make_unique<Factorization>(); }

}  // namespace semblance
