#include "semblance/cloth/block_matrix.h"

#include <algorithm>

#include "semblance/core/parallel.h"

namespace semblance {
namespace {

constexpr int chunk_rows = 1024;

using Float4 = float __attribute__((vector_size(16)));

Float4 load(const float* p) {
  Float4 v;
  __builtin_memcpy(&v, p, sizeof(v));
  return v;
}

/// Adds what a coupling gives beyond its diagonal blocks.
void add_mixed(const Coupling& coupling, const BlockVector& x, BlockVector& y) {
  const auto& s = coupling.stiffness;
  Eigen::Matrix3f k;
  k << s[0], s[1], s[2], s[1], s[3], s[4], s[2], s[4], s[5];
  Eigen::Vector3f motion = Eigen::Vector3f::Zero();
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

void BlockMatrix::multiply(const BlockVector& x, BlockVector& y) const {
  const int rows = pattern->row_count();
  y.resize(4, rows);
  parallel_for((rows + chunk_rows - 1) / chunk_rows, [&](std::size_t c) {
    const int end = std::min(rows, (static_cast<int>(c) + 1) * chunk_rows);
    for (int r = static_cast<int>(c) * chunk_rows; r < end; ++r) {
      Float4 sum = {0.0f, 0.0f, 0.0f, 0.0f};
      for (int k = pattern->begin[r]; k < pattern->begin[r + 1]; ++k) {
        const float* block = blocks[k].data();
        const float* v = x.data() + 4 * static_cast<std::ptrdiff_t>(pattern->column[k]);
        sum += load(block) * v[0] + load(block + 4) * v[1] + load(block + 8) * v[2];
      }
      __builtin_memcpy(y.data() + 4 * static_cast<std::ptrdiff_t>(r), &sum, sizeof(sum));
    }
  });
  for (const Coupling& coupling : couplings) add_mixed(coupling, x, y);
}

}  // namespace semblance
