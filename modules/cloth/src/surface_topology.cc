#include "surface_topology.h"

#include <Eigen/Geometry>
#include <algorithm>

namespace semblance {
namespace {

std::array<int, 2> side(const Triangles& triangles, Eigen::Index t, int k) {
  const int a = triangles(t, k), b = triangles(t, (k + 1) % 3);
  return {std::min(a, b), std::max(a, b)};
}

std::vector<std::array<int, 2>> sorted_edges(const Triangles& triangles) {
  std::vector<std::array<int, 2>> edges;
  for (Eigen::Index t = 0; t < triangles.rows(); ++t)
    for (int k = 0; k < 3; ++k) edges.push_back(side(triangles, t, k));
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  return edges;
}

}  // namespace

SurfaceTopology make_topology(const Points& rest_positions_m, const Triangles& triangles,
                              const std::vector<int>& order) {
  SurfaceTopology result;
  result.triangles.resize(triangles.rows(), 3);
  for (std::size_t t = 0; t < order.size(); ++t)
    result.triangles.row(static_cast<Eigen::Index>(t)) = triangles.row(order[t]);
  const std::vector<std::array<int, 2>> sorted = sorted_edges(triangles);
  std::vector<int> number(sorted.size(), -1);
  result.owned.resize(order.size());
  result.vertex_area_m2 = Eigen::VectorXd::Zero(rest_positions_m.rows());
  result.edge_area_m2 = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(sorted.size()));
  std::vector<bool> vertex_taken(rest_positions_m.rows());
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    const auto corners = result.triangles.row(t);
    const Eigen::Vector3d a = rest_positions_m.row(corners[0]);
    const Eigen::Vector3d b = rest_positions_m.row(corners[1]);
    const Eigen::Vector3d c = rest_positions_m.row(corners[2]);
    const double third = (b - a).cross(c - a).norm() / 6.0;
    SurfaceTopology::Owned& owned = result.owned[t];
    for (int k = 0; k < 3; ++k) {
      const int vertex = corners[k];
      result.vertex_area_m2[vertex] += third;
      if (!vertex_taken[vertex]) owned.vertices[owned.vertex_count++] = vertex;
      vertex_taken[vertex] = true;
      const std::array<int, 2> ends = side(result.triangles, t, k);
      int& edge = number[std::lower_bound(sorted.begin(), sorted.end(), ends) - sorted.begin()];
      if (edge < 0) {
        edge = static_cast<int>(result.edges.size());
        owned.edges[owned.edge_count++] = edge;
        result.edges.push_back(ends);
      }
      result.edge_area_m2[edge] += third;
    }
  }
  return result;
}

}  // namespace semblance
