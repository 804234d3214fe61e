// Loops over the columns of vectors on several threads.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <vector>

#include "semblance/core/parallel.h"

namespace semblance {

constexpr Eigen::Index chunk_columns = 16384;

inline Eigen::Index chunk_count(Eigen::Index columns) {
  return (columns + chunk_columns - 1) / chunk_columns;
}

/// Calls body(chunk, first column, number of columns). Chunks are large: below that waking other
/// threads takes longer than the work.
template <class Body>
void for_column_chunks(Eigen::Index columns, const Body& body) {
  parallel_for(chunk_count(columns), [&](std::size_t c) {
    const Eigen::Index first = static_cast<Eigen::Index>(c) * chunk_columns;
    body(c, first, std::min(chunk_columns, columns - first));
  });
}

/// Sum of body(first column, number of columns) over chunks, in their order: the same for every
/// number of threads.
template <class Body>
double sum_over_columns(Eigen::Index columns, const Body& body) {
  std::vector<double> sums(chunk_count(columns), 0.0);
  for_column_chunks(columns, [&](std::size_t c, Eigen::Index first, Eigen::Index n) {
    sums[c] = body(first, n);
  });
  double sum = 0.0;
  for (const double s : sums) sum += s;
  return sum;
}

}  // namespace semblance
