#include "bounds_tree.h"

#include <numeric>

namespace semblance {

BoundsTree::BoundsTree(const Points& positions_m, const Triangles& triangles, int leaf_size) {
  Points centres(triangles.rows(), 3);
  for (Eigen::Index t = 0; t < triangles.rows(); ++t)
    centres.row(t) = positions_m.row(triangles(t, 0)) + positions_m.row(triangles(t, 1)) +
                     positions_m.row(triangles(t, 2));
  order_.resize(triangles.rows());
  std::iota(order_.begin(), order_.end(), 0);
  nodes_.reserve(2 * order_.size() + 1);
  nodes_.push_back({0, 0});
  split(0, 0, static_cast<int>(order_.size()), leaf_size, centres);
}

void BoundsTree::renumber() { std::iota(order_.begin(), order_.end(), 0); }

void BoundsTree::split(int node, int first, int count, int leaf_size, const Points& centres) {
  if (count <= leaf_size) {
    nodes_[node] = {first, count};
    return;
  }
  Eigen::RowVector3d lower = centres.row(order_[first]), upper = lower;
  for (int i = first; i < first + count; ++i) {
    lower = lower.cwiseMin(centres.row(order_[i]));
    upper = upper.cwiseMax(centres.row(order_[i]));
  }
  Eigen::Index axis;
  (upper - lower).maxCoeff(&axis);
  const auto begin = order_.begin() + first, middle = begin + count / 2;
  std::nth_element(begin, middle, begin + count, [&](int i, int j) {
    const double a = centres(i, axis), b = centres(j, axis);
    return a < b || (a == b && i < j);
  });
  const int children = static_cast<int>(nodes_.size());
  nodes_[node] = {children, 0};
  nodes_.resize(children + 2);
  split(children, first, count / 2, leaf_size, centres);
  split(children + 1, first + count / 2, count - count / 2, leaf_size, centres);
}

}  // namespace semblance
