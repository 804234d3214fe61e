#include "semblance/cloth/block_matrix.h"

#include <algorithm>

#include "row_product.h"
#include "semblance/core/parallel.h"

namespace semblance {
namespace {

constexpr int chunk_rows = 1024;

SEMBLANCE_WIDE void multiply_rows(const BlockMatrix& a, const double* x, double* y, int first,
                                  int last) {
  const int* begin = a.pattern->begin.data();
  const int* column = a.pattern->column.data();
  for (int r = first; r < last; ++r) {
    const Double4 sum = row_product(a, begin, column, x, r);
    __builtin_memcpy(y + 4 * static_cast<std::ptrdiff_t>(r), &sum, sizeof(sum));
  }
}

Eigen::Vector3d product(const Symmetric3& s, const Eigen::Vector3d& x) {
  return {s[0] * x[0] + s[1] * x[1] + s[2] * x[2], s[1] * x[0] + s[3] * x[1] + s[4] * x[2],
          s[2] * x[0] + s[4] * x[1] + s[5] * x[2]};
}

/// Adds a link's product to rows first ... last - 1.
void multiply_link(const Link& link, const BlockVector& x, int first, int last, BlockVector& y) {
  Eigen::Vector3d r = Eigen::Vector3d::Zero();
  for (int i = 0; i < 4 && link.vertex[i] >= 0; ++i)
    r += link.weight[i] * x.col(link.vertex[i]).head<3>();
  const Eigen::Vector3d product_r = product(link.stiffness, r);
  for (int i = 0; i < 4 && link.vertex[i] >= 0; ++i) {
    const int v = link.vertex[i];
    if (v >= first && v < last) y.col(v).head<3>() += link.weight[i] * product_r;
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

void BlockMatrix::add(const std::array<int, 4>& vertex, const std::array<double, 4>& weight,
                      const Eigen::Matrix3d& stiffness) {
  Link link{vertex,
            weight,
            {stiffness(0, 0), stiffness(0, 1), stiffness(0, 2), stiffness(1, 1), stiffness(1, 2),
             stiffness(2, 2)}};
  for (int i = 0; i < 4 && vertex[i] >= 0; ++i) {
    if (!fixed.empty() && fixed[vertex[i]]) link.weight[i] = 0.0;
  }
  links.push_back(link);
}

/// Chunks of rows are multiplied on their own, so each has all links that reach into it.
void BlockMatrix::list_links() {
  links_of_chunk.assign((pattern->row_count() + chunk_rows - 1) / chunk_rows, {});
  for (int k = 0; k < static_cast<int>(links.size()); ++k) {
    for (int i = 0; i < 4 && links[k].vertex[i] >= 0; ++i) {
      std::vector<int>& list = links_of_chunk[links[k].vertex[i] / chunk_rows];
      if (list.empty() || list.back() != k) list.push_back(k);
    }
  }
}

void BlockMatrix::complete() {
  const int rows = pattern->row_count();
  list_links();
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
  for (const Link& link : links) {
    for (int i = 0; i < 4 && link.vertex[i] >= 0; ++i) {
      const double scale = link.weight[i] * link.weight[i];
      for (int k = 0; k < 6; ++k) diagonal[link.vertex[i]][k] += scale * link.stiffness[k];
    }
  }
}

void BlockMatrix::multiply(const BlockVector& x, BlockVector& y) const {
  const int rows = pattern->row_count();
  y.resize(4, rows);
  parallel_for((rows + chunk_rows - 1) / chunk_rows, [&](std::size_t c) {
    const int first = static_cast<int>(c) * chunk_rows, last = std::min(rows, first + chunk_rows);
    multiply_rows(*this, x.data(), y.data(), first, last);
    for (const int k : links_of_chunk[c]) multiply_link(links[k], x, first, last, y);
  });
  for (std::size_t r = 0; r < fixed.size(); ++r) {
    if (fixed[r]) y.col(r) = x.col(r);
  }
}

}  // namespace semblance
