#include "semblance/cloth/assembly.h"

#include <algorithm>

#include "semblance/core/parallel.h"

namespace semblance {
namespace {

constexpr int chunk_blocks = 4096;

std::vector<std::vector<int>> neighbours_of(const Deformation& deformation, int vertex_count) {
  std::vector<std::vector<int>> neighbours(vertex_count);
  const auto couple = [&](std::span<const StrainEntry> a, std::span<const StrainEntry> b) {
    for (const StrainEntry& i : a) {
      for (const StrainEntry& j : b) neighbours[i.vertex].push_back(j.vertex);
    }
  };
  for (int e = 0; e < deformation.row_count(); ++e) {
    couple(deformation.row(e), deformation.row(e));
  }
  const int a = deformation.first(StrainKind::shear_warp);
  const int b = deformation.first(StrainKind::shear_weft);
  for (int k = 0; a + k < deformation.last(StrainKind::shear_warp); ++k) {
    couple(deformation.row(a + k), deformation.row(b + k));
  }
  return neighbours;
}

}  // namespace

Assembly::Assembly(const Deformation& deformation, int vertex_count, std::vector<bool> fixed)
    : pattern_(make_pattern(neighbours_of(deformation, vertex_count))), fixed_(std::move(fixed)) {
  for (int r = 0; r < vertex_count; ++r) {
    for (int k = pattern_.diagonal[r] + 1; k < pattern_.begin[r + 1]; ++k) {
      if (!is_fixed(r) || !is_fixed(pattern_.column[k])) upper_.push_back(k);
    }
  }
  add_row_shares(deformation);
  add_shear_shares(deformation);
}

namespace {

/// Sorts (block, share) pairs into stretches by the position of the block in `blocks`.
template <class Share>
void pack(std::vector<std::pair<int, Share>>& loose, const std::vector<int>& blocks,
          std::vector<int>& begin, std::vector<Share>& shares) {
  std::stable_sort(loose.begin(), loose.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  begin.assign(1, 0);
  std::size_t next = 0;
  for (const int block : blocks) {
    while (next < loose.size() && loose[next].first < block) ++next;
    for (; next < loose.size() && loose[next].first == block; ++next) {
      shares.push_back(loose[next].second);
    }
    begin.push_back(static_cast<int>(shares.size()));
  }
}

}  // namespace

void Assembly::add_row_shares(const Deformation& deformation) {
  std::vector<std::pair<int, Share>> loose;
  for (int e = 0; e < deformation.row_count(); ++e) {
    for (const StrainEntry& i : deformation.row(e)) {
      for (const StrainEntry& j : deformation.row(e)) {
        if (j.vertex <= i.vertex) continue;
        const float weight = static_cast<float>(i.coefficient * j.coefficient);
        loose.emplace_back(pattern_.find(i.vertex, j.vertex), Share{e, weight});
      }
    }
  }
  pack(loose, upper_, row_begin_, row_shares_);
}

/// The mixed Hessian H of a pair stands in block (i, j) as a_i b_j H + b_i a_j H'.
void Assembly::add_shear_shares(const Deformation& deformation) {
  std::vector<std::pair<int, Share>> loose, transposed;
  const int a = deformation.first(StrainKind::shear_warp);
  const int b = deformation.first(StrainKind::shear_weft);
  for (int pair = 0; a + pair < deformation.last(StrainKind::shear_warp); ++pair) {
    for (const StrainEntry& i : deformation.row(a + pair)) {
      for (const StrainEntry& j : deformation.row(b + pair)) {
        const float weight = static_cast<float>(i.coefficient * j.coefficient);
        if (i.vertex < j.vertex) {
          loose.emplace_back(pattern_.find(i.vertex, j.vertex), Share{pair, weight});
        }
        if (j.vertex < i.vertex) {
          transposed.emplace_back(pattern_.find(j.vertex, i.vertex), Share{pair, weight});
        }
      }
    }
  }
  pack(loose, upper_, shear_begin_, shear_shares_);
  pack(transposed, upper_, shear_transposed_begin_, shear_transposed_shares_);
}

void Assembly::assemble_block(const StrainHessian& hessian, int k,
                              std::array<float, 12>& out) const {
  std::array<float, 8> s{};
  for (int i = row_begin_[k]; i < row_begin_[k + 1]; ++i) {
    const float* h = hessian.rows[row_shares_[i].row].data();
    for (int c = 0; c < 8; ++c) s[c] += row_shares_[i].weight * h[c];
  }
  out = {s[0], s[1], s[2], 0.0f, s[1], s[3], s[4], 0.0f, s[2], s[4], s[5], 0.0f};
  for (int i = shear_begin_[k]; i < shear_begin_[k + 1]; ++i) {
    const float* h = hessian.shear[shear_shares_[i].row].data();
    for (int c = 0; c < 12; ++c) out[c] += shear_shares_[i].weight * h[c];
  }
  std::array<float, 12> t{};
  for (int i = shear_transposed_begin_[k]; i < shear_transposed_begin_[k + 1]; ++i) {
    const float* h = hessian.shear[shear_transposed_shares_[i].row].data();
    for (int c = 0; c < 12; ++c) t[c] += shear_transposed_shares_[i].weight * h[c];
  }
  for (int c = 0; c < 3; ++c) {
    for (int r = 0; r < 3; ++r) out[4 * c + r] += t[4 * r + c];
  }
}

void Assembly::assemble(const StrainHessian& hessian, BlockMatrix& out) const {
  out.pattern = &pattern_;
  out.links.clear();
  out.blocks.resize(pattern_.block_count());
  out.own.assign(pattern_.row_count(), {});
  out.fixed = fixed_;
  const int count = static_cast<int>(upper_.size());
  parallel_for((count + chunk_blocks - 1) / chunk_blocks, [&](std::size_t chunk) {
    const int begin = static_cast<int>(chunk) * chunk_blocks;
    for (int k = begin; k < std::min(count, begin + chunk_blocks); ++k) {
      std::array<float, 12>& block = out.blocks[upper_[k]];
      assemble_block(hessian, k, block);
      const int mirror = pattern_.mirror[upper_[k]];
      for (int c = 0; c < 3; ++c) {
        for (int r = 0; r < 3; ++r) out.blocks[mirror][4 * c + r] = block[4 * r + c];
      }
    }
  });
}

}  // namespace semblance
