// Symmetric approximate inverses for conjugate gradients.
#pragma once

#include <memory>

#include "semblance/cloth/block_matrix.h"
#include "semblance/cloth/sheet.h"

namespace semblance {

class Preconditioner {
 public:
  virtual ~Preconditioner() = default;
  virtual void prepare(const BlockMatrix& matrix) = 0;
  /// z = M^-1 r.
  virtual void apply(const BlockVector& r, BlockVector& z) = 0;
};

std::unique_ptr<Preconditioner> make_jacobi();
std::unique_ptr<Preconditioner> make_factorization();
std::unique_ptr<Preconditioner> make_lines(const SheetGrid& grid);
/// `fine`, and a coarse grid for what is smooth.
std::unique_ptr<Preconditioner> make_two_level(std::unique_ptr<Preconditioner> fine,
                                               const SheetGrid& grid);

}  // namespace semblance
