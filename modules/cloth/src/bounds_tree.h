// A tree over the triangles of a mesh whose shape changes and whose neighbourhoods do not: split
// once, its bounds refitted to each new shape. What a bound is and when two meet is the caller's.
#pragma once

#ifdef __SSE__
#include <xmmintrin.h>
#endif

#include <Eigen/Core>
#include <algorithm>
#include <utility>
#include <vector>

#include "semblance/cloth/points.h"
#include "semblance/core/parallel.h"

namespace semblance {

/// Axis-parallel box in float; the fourth numbers are 0. Whoever fills one rounds outwards.
struct alignas(16) Box {
  float lower[4] = {}, upper[4] = {};

  bool meets(const Box& other) const;
  void include(const Box& other) {
    for (int k = 0; k < 4; ++k) {
      lower[k] = std::min(lower[k], other.lower[k]);
      upper[k] = std::max(upper[k], other.upper[k]);
    }
  }
};

inline bool Box::meets(const Box& other) const {
#ifdef __SSE__
  const __m128 not_above = _mm_cmple_ps(_mm_load_ps(lower), _mm_load_ps(other.upper));
  const __m128 not_below = _mm_cmple_ps(_mm_load_ps(other.lower), _mm_load_ps(upper));
  return _mm_movemask_ps(_mm_and_ps(not_above, not_below)) == 15;
#else
  for (int k = 0; k < 3; ++k)
    if (lower[k] > other.upper[k] || other.lower[k] > upper[k]) return false;
  return true;
#endif
}

class BoundsTree {
 public:
  /// An inner node has the children `first` and `first` + 1; a leaf (count > 0) holds the triangles
  /// order()[first] .. order()[first + count - 1].
  struct Node {
    int first, count;
  };
  using NodePair = std::pair<int, int>;

  /// Halves the triangles at the median of their centres until `leaf_size` are left.
  BoundsTree(const Points& positions_m, const Triangles& triangles, int leaf_size = 2);

  const std::vector<Node>& nodes() const { return nodes_; }
  const std::vector<int>& order() const { return order_; }
  /// Tells the tree that the triangles have been put in its order.
  void renumber();

  /// Bounds of all nodes from those of the triangles.
  template <typename Bound>
  void refit(const std::vector<Bound>& of_triangles, std::vector<Bound>& of_nodes) const;

  /// Some 64 pairs of nodes that together hold every pair of triangles whose bounds meet (meet(n,
  /// m) on nodes): work for parallel_for, in an order that depends on nothing else.
  template <typename Meet>
  std::vector<NodePair> self_tasks(const Meet& meet) const;

  /// The same for pairs of a node of one tree and one of another.
  template <typename Meet>
  static std::vector<NodePair> cross_tasks(const BoundsTree& a, const BoundsTree& b,
                                           const Meet& meet);

  /// leaf(i, j) for every pair of triangles below a pair of nodes, where nodes meet all the way
  /// down. A node paired with itself stands for the pairs within it, each once.
  template <typename Meet, typename Leaf>
  void self_pairs(NodePair pair, const Meet& meet, const Leaf& leaf) const;

  /// leaf(i, j) for triangles i here and j of the other tree.
  template <typename Meet, typename Leaf>
  static void cross_pairs(const BoundsTree& a, const BoundsTree& b, NodePair pair, const Meet& meet,
                          const Leaf& leaf);

  /// leaf(i) for the triangles of all leaves that `meets` (of a node) leads to.
  template <typename Meet, typename Leaf>
  void query(const Meet& meets, const Leaf& leaf) const;

 private:
  /// Splits pairs until there are enough; false: that one cannot be split.
  template <typename Split>
  static std::vector<NodePair> split_tasks(const Split& split_one);
  template <typename Meet>
  static bool split_pair(const BoundsTree& a, const BoundsTree& b, NodePair pair, const Meet& meet,
                         std::vector<NodePair>& out);
  void split(int node, int first, int count, int leaf_size, const Points& centres);

  std::vector<Node> nodes_;
  std::vector<int> order_;
};

template <typename Bound>
void BoundsTree::refit(const std::vector<Bound>& of_triangles, std::vector<Bound>& of_nodes) const {
  of_nodes.resize(nodes_.size());
  for (std::size_t n = nodes_.size(); n-- > 0;) {  // children come after their parent
    const Node& node = nodes_[n];
    if (node.count == 0) {
      of_nodes[n] = of_nodes[node.first];
      of_nodes[n].include(of_nodes[node.first + 1]);
      continue;
    }
    of_nodes[n] = of_triangles[order_[node.first]];
    for (int k = 1; k < node.count; ++k) of_nodes[n].include(of_triangles[order_[node.first + k]]);
  }
}

template <typename Meet>
std::vector<BoundsTree::NodePair> BoundsTree::self_tasks(const Meet& meet) const {
  return split_tasks([&](NodePair pair, std::vector<NodePair>& out) {
    const auto [a, b] = pair;
    if (a != b) return split_pair(*this, *this, pair, meet, out);
    if (nodes_[a].count > 0) return false;
    const int child = nodes_[a].first;
    out.insert(out.end(), {{child, child}, {child + 1, child + 1}});
    if (meet(child, child + 1)) out.emplace_back(child, child + 1);
    return true;
  });
}

template <typename Meet>
std::vector<BoundsTree::NodePair> BoundsTree::cross_tasks(const BoundsTree& a, const BoundsTree& b,
                                                          const Meet& meet) {
  if (!meet(0, 0)) return {};
  return split_tasks(
      [&](NodePair pair, std::vector<NodePair>& out) { return split_pair(a, b, pair, meet, out); });
}

template <typename Split>
std::vector<BoundsTree::NodePair> BoundsTree::split_tasks(const Split& split_one) {
  constexpr std::size_t enough = 64;
  std::vector<NodePair> tasks{{0, 0}}, next;
  for (bool changed = true; changed && tasks.size() < enough; tasks.swap(next)) {
    next.clear();
    changed = false;
    for (const NodePair& pair : tasks) {
      if (split_one(pair, next)) {
        changed = true;
      } else {
        next.push_back(pair);
      }
    }
  }
  return tasks;
}

template <typename Meet>
bool BoundsTree::split_pair(const BoundsTree& a, const BoundsTree& b, NodePair pair,
                            const Meet& meet, std::vector<NodePair>& out) {
  const Node &n = a.nodes_[pair.first], &m = b.nodes_[pair.second];
  if (n.count > 0 || m.count > 0) return false;
  for (const int i : {n.first, n.first + 1})
    for (const int j : {m.first, m.first + 1})
      if (meet(i, j)) out.emplace_back(i, j);
  return true;
}

template <typename Meet, typename Leaf>
void BoundsTree::self_pairs(NodePair pair, const Meet& meet, const Leaf& leaf) const {
  if (pair.first != pair.second) return cross_pairs(*this, *this, pair, meet, leaf);
  const Node& node = nodes_[pair.first];
  if (node.count > 0) {
    for (int i = 0; i < node.count; ++i)
      for (int j = i + 1; j < node.count; ++j) leaf(order_[node.first + i], order_[node.first + j]);
    return;
  }
  self_pairs({node.first, node.first}, meet, leaf);
  self_pairs({node.first + 1, node.first + 1}, meet, leaf);
  self_pairs({node.first, node.first + 1}, meet, leaf);
}

template <typename Meet, typename Leaf>
void BoundsTree::cross_pairs(const BoundsTree& a, const BoundsTree& b, NodePair pair,
                             const Meet& meet, const Leaf& leaf) {
  if (!meet(pair.first, pair.second)) return;
  const Node &n = a.nodes_[pair.first], &m = b.nodes_[pair.second];
  if (n.count > 0 && m.count > 0) {
    for (int i = 0; i < n.count; ++i)
      for (int j = 0; j < m.count; ++j) leaf(a.order_[n.first + i], b.order_[m.first + j]);
  } else if (m.count > 0) {
    cross_pairs(a, b, {n.first, pair.second}, meet, leaf);
    cross_pairs(a, b, {n.first + 1, pair.second}, meet, leaf);
  } else if (n.count > 0) {
    cross_pairs(a, b, {pair.first, m.first}, meet, leaf);
    cross_pairs(a, b, {pair.first, m.first + 1}, meet, leaf);
  } else {
    cross_pairs(a, b, {n.first, m.first}, meet, leaf);
    cross_pairs(a, b, {n.first, m.first + 1}, meet, leaf);
    cross_pairs(a, b, {n.first + 1, m.first}, meet, leaf);
    cross_pairs(a, b, {n.first + 1, m.first + 1}, meet, leaf);
  }
}

template <typename Meet, typename Leaf>
void BoundsTree::query(const Meet& meets, const Leaf& leaf) const {
  int stack[64], size = 0;  // the tree is balanced: its depth is below 32
  stack[size++] = 0;
  while (size > 0) {
    const int n = stack[--size];
    if (!meets(n)) continue;
    const Node& node = nodes_[n];
    for (int k = 0; k < node.count; ++k) leaf(order_[node.first + k]);
    if (node.count == 0) {
      stack[size++] = node.first + 1;
      stack[size++] = node.first;
    }
  }
}

}  // namespace semblance
