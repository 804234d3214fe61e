#include "surface_topology.h"

#include <Eigen/Geometry>
#include <algorithm>

namespace semblance {
namespace {

std::array<int, 2> side(const Triangles& triangles, Eigen::Index t, int k) {
  const int a = triangles(t, k), b = triangles(t, (k + 1) % 3);
  return {std::min(a, b), std::max(a, b)};
}

std::vector<std::array<int, 2>> all_edges(const Triangles& triangles) {
  std::vector<std::array<int, 2>> edges;
  for (Eigen::Index t = 0; t < triangles.rows(); ++t)
    for (int k = 0; k < 3; ++k) edges.push_back(side(triangles, t, k));
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  return edges;
}

}  // namespace

SurfaceTopology make_topology(const Points& rest_positions_m, const Triangles& triangles) {
  SurfaceTopology result;
  result.triangles = triangles;
  result.edges = all_edges(triangles);
  result.owned.resize(triangles.rows());
  result.vertex_area_m2 = Eigen::VectorXd::Zero(rest_positions_m.rows());
  result.edge_area_m2 = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(result.edges.size()));
  std::vector<bool> vertex_taken(rest_positions_m.rows()), edge_taken(result.edges.size());
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    const Eigen::Vector3d a = rest_positions_m.row(triangles(t, 0));
    const Eigen::Vector3d b = rest_positions_m.row(triangles(t, 1));
    const Eigen::Vector3d c = rest_positions_m.row(triangles(t, 2));
    const double third = (b - a).cross(c - a).norm() / 6.0;
    SurfaceTopology::Owned& owned = result.owned[t];
    for (int k = 0; k < 3; ++k) {
      const int vertex = triangles(t, k);
      result.vertex_area_m2[vertex] += third;
      if (!vertex_taken[vertex]) owned.vertices[owned.vertex_count++] = vertex;
      vertex_taken[vertex] = true;
      const auto found =
          std::lower_bound(result.edges.begin(), result.edges.end(), side(triangles, t, k));
      const int edge = static_cast<int>(found - result.edges.begin());
      result.edge_area_m2[edge] += third;
      if (!edge_taken[edge]) owned.edges[owned.edge_count++] = edge;
      edge_taken[edge] = true;
    }
  }
  return result;
}

}  // namespace semblance
