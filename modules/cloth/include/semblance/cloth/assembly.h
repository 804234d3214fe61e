// From second derivatives in a sheet's strains to the matrix in its vertices.
#pragma once

#include <vector>

#include "semblance/cloth/block_matrix.h"
#include "semblance/cloth/sheet_energy.h"

namespace semblance {

/// Which blocks a sheet's Hessian has, and which strains each of them gathers. Made once for a
/// mesh. Assembly runs over blocks, on several threads, without colouring or locks, and sums in an
/// order that does not depend on the threads.
class Assembly {
 public:
  /// Rows and columns of `fixed` vertices are those of the identity.
  Assembly(const Deformation& deformation, int vertex_count, std::vector<bool> fixed);
  Assembly(const Assembly&) = delete;
  Assembly& operator=(const Assembly&) = delete;

  const BlockPattern& pattern() const { return pattern_; }
  bool is_fixed(int vertex) const { return !fixed_.empty() && fixed_[vertex]; }
  /// The mixed blocks of D' H D into `out`; `out.own` is zeroed and `out.links` emptied, for
  /// the caller to add to and then to complete the diagonal.
  void assemble(const StrainHessian& hessian, BlockMatrix& out) const;

 private:
  /// weight * (Hessian of row `row`, or a mixed one of a shear pair).
  struct Share {
    int row;
    float weight;
  };
  void add_row_shares(const Deformation& deformation);
  void add_shear_shares(const Deformation& deformation);
  void assemble_block(const StrainHessian& hessian, int k, std::array<float, 12>& out) const;

  BlockPattern pattern_;
  std::vector<bool> fixed_;
  std::vector<int> upper_;  // blocks above the diagonal, but for those between fixed vertices
  // Shares of the blocks in `upper_`, in stretches.
  std::vector<int> row_begin_, shear_begin_, shear_transposed_begin_;
  std::vector<Share> row_shares_, shear_shares_, shear_transposed_shares_;
};

}  // namespace semblance
