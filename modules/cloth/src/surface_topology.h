// Edges of a triangle mesh, and which triangle speaks for each vertex and edge.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "semblance/cloth/points.h"

namespace semblance {

struct SurfaceTopology {
  /// The vertices and edges that a triangle stands for. Each is owned once, so pairs of owned parts
  /// of two triangles that are near name every near pair of parts once.
  struct Owned {
    int vertex_count = 0, edge_count = 0;
    int vertices[3], edges[3];
  };

  Triangles triangles;
  std::vector<std::array<int, 2>> edges;  // each once, smaller vertex first
  std::vector<Owned> owned;               // by each triangle
  Eigen::VectorXd vertex_area_m2;         // a third of the triangles around
  Eigen::VectorXd edge_area_m2;           // a third of the triangles beside
};

/// Triangles in the given order and edges in the order of their first triangle: what is near in
/// space is then near in memory.
SurfaceTopology make_topology(const Points& rest_positions_m, const Triangles& triangles,
                              const std::vector<int>& order);

}  // namespace semblance
