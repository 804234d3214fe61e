#include "semblance/cloth/block_matrix.h"

#include <algorithm>

#include "semblance/core/parallel.h"

namespace semblance {
namespace {

constexpr int chunk_rows = 1024;

using Float4 = float __attribute__((vector_size(16)));
using Double4 = double __attribute__((vector_size(32)));

Double4 load(const float* p) {
  Float4 v;
  __builtin_memcpy(&v, p, sizeof(v));
  return __builtin_convertvector(v, Double4);
}

Double4 load(const double* p) {
  Double4 v;
  __builtin_memcpy(&v, p, sizeof(v));
  return v;
}

/// Row r of A x, without couplings.
inline Double4 product(const BlockMatrix& a, const double* x, int r) {
  const Double4 mine = load(x + 4 * static_cast<std::ptrdiff_t>(r));
  if (!a.fixed.empty() && a.fixed[r]) return mine;
  const Symmetric3& s = a.own[r];
  Double4 sum = Double4{s[0], s[1], s[2], 0.0} * mine[0] + Double4{s[1], s[3], s[4], 0.0} * mine[1] +
                Double4{s[2], s[4], s[5], 0.0} * mine[2];
  const BlockPattern& pattern = *a.pattern;
  for (int k = pattern.begin[r]; k < pattern.begin[r + 1]; ++k) {
    // The diagonal's own block meets x_r - x_r.
    const float* block = a.blocks[k].data();
    const Double4 v = load(x + 4 * static_cast<std::ptrdiff_t>(pattern.column[k])) - mine;
    sum += load(block) * v[0] + load(block + 4) * v[1] + load(block + 8) * v[2];
  }
  return sum;
}

/// Adds what a coupling gives beyond its diagonal blocks.
void add_mixed(const Coupling& coupling, const BlockVector& x, BlockVector& y) {
  const Symmetric3& s = coupling.stiffness;
  Eigen::Matrix3d k;
  k << s[0], s[1], s[2], s[1], s[3], s[4], s[2], s[4], s[5];
  Eigen::Vector3d motion = Eigen::Vector3d::Zero();
  for (int i = 0; i < 4 && coupling.vertex[i] >= 0; ++i) {
    motion += coupling.weight[i] * x.col(coupling.vertex[i]).head<3>();
  }
  for (int i = 0; i < 4 && coupling.vertex[i] >= 0; ++i) {
    const int v = coupling.vertex[i];
    y.col(v).head<3>() +=
        coupling.weight[i] * (k * (motion - coupling.weight[i] * x.col(v).head<3>()));
  }
}

}  // namespace

int BlockPattern::find(int row, int wanted) const {
  const auto first = column.begin() + begin[row], last = column.begin() + begin[row + 1];
  const auto found = std::lower_bound(first, last, wanted);
  return found != last && *found == wanted ? static_cast<int>(found - column.begin()) : -1;
}

BlockPattern make_pattern(std::vector<std::vector<int>> neighbours) {
  const int rows = static_cast<int>(neighbours.size());
  for (int r = 0; r < rows; ++r) {
    const std::size_t own = neighbours[r].size();
    for (std::size_t k = 0; k < own; ++k) {
      if (neighbours[r][k] != r) neighbours[neighbours[r][k]].push_back(r);
    }
    neighbours[r].push_back(r);
  }
  BlockPattern pattern;
  for (std::vector<int>& row : neighbours) {
    std::sort(row.begin(), row.end());
    row.erase(std::unique(row.begin(), row.end()), row.end());
    pattern.column.insert(pattern.column.end(), row.begin(), row.end());
    pattern.begin.push_back(pattern.block_count());
  }
  pattern.mirror.resize(pattern.block_count());
  for (int r = 0; r < rows; ++r) {
    pattern.diagonal.push_back(pattern.find(r, r));
    for (int k = pattern.begin[r]; k < pattern.begin[r + 1]; ++k) {
      pattern.mirror[k] = pattern.find(pattern.column[k], r);
    }
  }
  return pattern;
}

void BlockMatrix::complete_diagonal() {
  const int rows = pattern->row_count();
  diagonal.resize(rows);
  parallel_for((rows + chunk_rows - 1) / chunk_rows, [&](std::size_t c) {
    const int end = std::min(rows, (static_cast<int>(c) + 1) * chunk_rows);
    for (int r = static_cast<int>(c) * chunk_rows; r < end; ++r) {
      if (!fixed.empty() && fixed[r]) {
        diagonal[r] = {1, 0, 0, 1, 0, 1};
        continue;
      }
      std::array<double, 6> sum{};
      for (int k = pattern->begin[r]; k < pattern->begin[r + 1]; ++k) {
        if (k == pattern->diagonal[r]) continue;
        const auto& b = blocks[k];
        sum[0] -= b[0], sum[1] -= b[1], sum[2] -= b[2];
        sum[3] -= b[5], sum[4] -= b[6], sum[5] -= b[10];
      }
      for (int i = 0; i < 6; ++i) diagonal[r][i] = sum[i] + own[r][i];
    }
  });
}

Eigen::Vector4d BlockMatrix::row_product(const BlockVector& x, int r) const {
  Eigen::Vector4d out;
  const Double4 sum = product(*this, x.data(), r);
  __builtin_memcpy(out.data(), &sum, sizeof(sum));
  return out;
}

void BlockMatrix::multiply(const BlockVector& x, BlockVector& y) const {
  const int rows = pattern->row_count();
  y.resize(4, rows);
  parallel_for((rows + chunk_rows - 1) / chunk_rows, [&](std::size_t c) {
    const int end = std::min(rows, (static_cast<int>(c) + 1) * chunk_rows);
    for (int r = static_cast<int>(c) * chunk_rows; r < end; ++r) {
      const Double4 sum = product(*this, x.data(), r);
      __builtin_memcpy(y.data() + 4 * static_cast<std::ptrdiff_t>(r), &sum, sizeof(sum));
    }
  });
  for (const Coupling& coupling : couplings) add_mixed(coupling, x, y);
}

}  // namespace semblance
