// The innermost loop of every product with a BlockMatrix.
#pragma once

#include "semblance/cloth/block_matrix.h"
#include "wide.h"

namespace semblance {

/// Row r of A x, without links.
[[gnu::always_inline]] inline Double4 row_product(const BlockMatrix& a, const int* begin,
                                                  const int* column, const double* x, int r) {
  const Double4 mine = load4(x + 4 * static_cast<std::ptrdiff_t>(r));
  const double* s = a.own[r].data();
  Double4 sum = Double4{s[0], s[1], s[2], 0.0} * mine[0] +
                Double4{s[1], s[3], s[4], 0.0} * mine[1] + Double4{s[2], s[4], s[5], 0.0} * mine[2];
  for (int k = begin[r]; k < begin[r + 1]; ++k) {
    // The diagonal's own block meets x_r - x_r.
    const float* block = a.blocks[k].data();
    const Double4 v = load4(x + 4 * static_cast<std::ptrdiff_t>(column[k])) - mine;
    sum += load4(block) * v[0] + load4(block + 4) * v[1] + load4(block + 8) * v[2];
  }
  return sum;
}

}  // namespace semblance
