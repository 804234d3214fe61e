// Linear systems with a sheet's matrix, behind one interface.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "semblance/cloth/block_matrix.h"
#include "semblance/cloth/sheet.h"

namespace semblance {

/// How a solve went.
struct LinearSolution {
  int iterations = 0;
  double relative_residual = 0.0;
  /// A direction along which the matrix is not positive was met: `x` is what was reached before.
  bool negative_curvature = false;
};

/// Solves A x = b for one matrix after another of the same pattern, each for as many right-hand
/// sides as wanted. Not for several threads at once.
class LinearSolver {
 public:
  virtual ~LinearSolver() = default;
  /// From now on A is `matrix`, which must stay as it is and where it is.
  virtual void prepare(const BlockMatrix& matrix) = 0;
  /// `x` holds the start, and gets the solution to |b - A x| <= tolerance |b|, or what was reached.
  virtual LinearSolution solve(const BlockVector& b, double tolerance, BlockVector& x) = 0;
};

/// "jacobi": conjugate gradients, preconditioned by the diagonal blocks.
/// "lines": by exact solves along warp and weft lines; needs a grid.
/// "two-level": by those and exact solves on a coarse grid, for matrices without much inertia,
/// where long waves count; needs a grid.
/// "direct": by the factorisation of the whole matrix, so one or two iterations do, for any mesh.
/// It takes as long as some hundred iterations of "lines": worth it where solutions must be exact,
/// or are many for one matrix.
std::unique_ptr<LinearSolver> make_linear_solver(const std::string& name, const Sheet& sheet);

}  // namespace semblance
