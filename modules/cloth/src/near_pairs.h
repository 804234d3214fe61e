// Bounds of surfaces, at rest or during a step, and the pairs of parts whose bounds meet.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "bounds_tree.h"
#include "surface_topology.h"

namespace semblance {

/// Elements of a pair (what they are depends on its kind), their gap when they were gathered, and
/// the share of thickness and reach that they keep (less than 1 for neighbours in the sheet).
struct NearPair {
  int a, b;
  float gap_m, scale;
};

/// Parts that move in straight lines: where they are, their displacements, and by how much they
/// have strayed at most from where they were when pairs were gathered, until the end of the step.
struct SweptBox {
  Box now, move;
  float strayed_m;

  void include(const SweptBox& other) {
    now.include(other.now);
    move.include(other.move);
    strayed_m = std::max(strayed_m, other.strayed_m);
  }
  /// Whether parts may come within `room_m` of each other in some axis each. Motion in common does
  /// not bring them together.
  bool meets(const SweptBox& other, float room_m) const;
};

inline bool SweptBox::meets(const SweptBox& other, float room_m) const {
#ifdef __SSE__
  const __m128 room = _mm_set1_ps(room_m), zero = _mm_setzero_ps();
  // How far the first is above the second, and how far it may sink towards it; and the same below.
  const __m128 above =
      _mm_sub_ps(_mm_sub_ps(_mm_load_ps(now.lower), _mm_load_ps(other.now.upper)), room);
  const __m128 sinks = _mm_sub_ps(_mm_load_ps(other.move.upper), _mm_load_ps(move.lower));
  const __m128 below =
      _mm_sub_ps(_mm_sub_ps(_mm_load_ps(other.now.lower), _mm_load_ps(now.upper)), room);
  const __m128 rises = _mm_sub_ps(_mm_load_ps(move.upper), _mm_load_ps(other.move.lower));
  const __m128 apart = _mm_or_ps(_mm_cmpgt_ps(above, _mm_max_ps(sinks, zero)),
                                 _mm_cmpgt_ps(below, _mm_max_ps(rises, zero)));
  return _mm_movemask_ps(apart) == 0;
#else
  for (int k = 0; k < 3; ++k) {
    const float above = now.lower[k] - other.now.upper[k] - room_m;
    const float below = other.now.lower[k] - now.upper[k] - room_m;
    if (above > std::max(other.move.upper[k] - move.lower[k], 0.0f)) return false;
    if (below > std::max(move.upper[k] - other.move.lower[k], 0.0f)) return false;
  }
  return true;
#endif
}

/// Smallest box of floats about a point and what is within `inflation_m` of it.
template <typename Point>
Box box_around(const Point& point, double inflation_m) {
  Box box;
  for (int k = 0; k < 3; ++k) {
    const double rounding = 1.2e-7 * std::abs(point[k]) + 1e-30;  // a little over half a unit
    box.lower[k] = static_cast<float>(point[k] - inflation_m - rounding);
    box.upper[k] = static_cast<float>(point[k] + inflation_m + rounding);
  }
  return box;
}

/// body(i) for 0 <= i < count, on several threads where that pays.
template <typename Body>
void for_chunks(std::size_t count, const Body& body) {
  constexpr std::size_t chunk = 4096;
  parallel_for((count + chunk - 1) / chunk, [&](std::size_t c) {
    for (std::size_t i = c * chunk; i < std::min(count, (c + 1) * chunk); ++i) body(i);
  });
}

/// Bounds of all parts of a surface; those of its vertices are given.
template <typename Bound>
struct SurfaceBounds {
  std::vector<Bound> vertices, edges, triangles, nodes;

  void fit(const SurfaceTopology& topology, const BoundsTree& tree) {
    edges.resize(topology.edges.size());
    triangles.resize(topology.owned.size());
    for_chunks(edges.size(), [&](std::size_t e) {
      edges[e] = vertices[topology.edges[e][0]];
      edges[e].include(vertices[topology.edges[e][1]]);
    });
    for_chunks(triangles.size(), [&](std::size_t t) {
      const auto corners = topology.triangles.row(static_cast<Eigen::Index>(t));
      triangles[t] = vertices[corners[0]];
      triangles[t].include(vertices[corners[1]]);
      triangles[t].include(vertices[corners[2]]);
    });
    tree.refit(triangles, nodes);
  }
};

/// Calls vertex_triangle(v, t) and edge_edge(e, f) for parts of triangles i and j of one surface
/// that share no vertex and whose bounds meet; each pair of parts belongs to one pair of triangles.
template <typename Bound, typename Meet, typename VertexTriangle, typename EdgeEdge>
void for_parts_within(const SurfaceTopology& s, const SurfaceBounds<Bound>& bounds, int i, int j,
                      const Meet& meet, const VertexTriangle& vertex_triangle,
                      const EdgeEdge& edge_edge) {
  const SurfaceTopology::Owned &of_i = s.owned[i], &of_j = s.owned[j];
  const auto vertices_on = [&](const SurfaceTopology::Owned& owned, int t) {
    const auto corners = s.triangles.row(t);
    for (int k = 0; k < owned.vertex_count; ++k) {
      const int v = owned.vertices[k];
      if (v != corners[0] && v != corners[1] && v != corners[2] &&
          meet(bounds.vertices[v], bounds.triangles[t]))
        vertex_triangle(v, t);
    }
  };
  vertices_on(of_i, j);
  vertices_on(of_j, i);
  for (int k = 0; k < of_i.edge_count; ++k) {
    const int e = of_i.edges[k];
    const auto [a, b] = s.edges[e];
    for (int l = 0; l < of_j.edge_count; ++l) {
      const int f = of_j.edges[l];
      const auto [c, d] = s.edges[f];
      if (a != c && a != d && b != c && b != d && meet(bounds.edges[e], bounds.edges[f]))
        edge_edge(std::min(e, f), std::max(e, f));
    }
  }
}

/// The same for triangle i of a surface and j of another one, with triangle_vertex(t, v) for
/// vertices of the other.
template <typename Bound, typename Meet, typename VertexTriangle, typename EdgeEdge,
          typename TriangleVertex>
void for_parts_between(const SurfaceTopology& s, const SurfaceBounds<Bound>& bounds, int i,
                       const SurfaceTopology& other, const SurfaceBounds<Bound>& other_bounds,
                       int j, const Meet& meet, const VertexTriangle& vertex_triangle,
                       const EdgeEdge& edge_edge, const TriangleVertex& triangle_vertex) {
  const SurfaceTopology::Owned &of_i = s.owned[i], &of_j = other.owned[j];
  for (int k = 0; k < of_i.vertex_count; ++k)
    if (meet(bounds.vertices[of_i.vertices[k]], other_bounds.triangles[j]))
      vertex_triangle(of_i.vertices[k], j);
  for (int k = 0; k < of_i.edge_count; ++k)
    for (int l = 0; l < of_j.edge_count; ++l)
      if (meet(bounds.edges[of_i.edges[k]], other_bounds.edges[of_j.edges[l]]))
        edge_edge(of_i.edges[k], of_j.edges[l]);
  for (int l = 0; l < of_j.vertex_count; ++l)
    if (meet(bounds.triangles[i], other_bounds.vertices[of_j.vertices[l]]))
      triangle_vertex(i, of_j.vertices[l]);
}

/// Sorts by a (below `count_of_a`), then b. Linear in time where few pairs have the same a.
void sort_pairs(std::vector<NearPair>& pairs, int count_of_a, std::vector<NearPair>& scratch,
                std::vector<int>& starts);

/// Neighbours in the sheet whose distance at rest is below thickness plus reach. Barriers of their
/// own size would push them apart at rest. Both lengths are scaled for them by 0.9 of that distance
/// over their sum: nothing pushes at rest, and still nothing passes. Pairs that touch at rest have
/// the scale 0 and are left alone.
class RestNeighbours {
 public:
  void add(int a, int b, bool edges, float scale) { scales_.emplace_back(key(a, b, edges), scale); }
  void finish() { std::sort(scales_.begin(), scales_.end()); }
  float scale(int a, int b, bool edges) const {
    if (scales_.empty()) return 1.0f;
    const std::uint64_t wanted = key(a, b, edges);
    const auto found = std::lower_bound(scales_.begin(), scales_.end(), wanted,
                                        [](const auto& s, std::uint64_t k) { return s.first < k; });
    return found != scales_.end() && found->first == wanted ? found->second : 1.0f;
  }

 private:
  static std::uint64_t key(int a, int b, bool edges) {
    return std::uint64_t{edges} << 63 | std::uint64_t(a) << 31 | std::uint64_t(b);
  }
  std::vector<std::pair<std::uint64_t, float>> scales_;
};

}  // namespace semblance
