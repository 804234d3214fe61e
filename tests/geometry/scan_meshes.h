// Closed surfaces around the y axis for tests of scans.
#pragma once

#include <cmath>
#include <functional>
#include <numbers>

#include "semblance/core/mesh.h"

namespace semblance::testing {

/// Vertices on `rings` + 1 circles of latitude from pole to pole; `place` gives the point at
/// longitude and latitude.
inline Mesh make_globe(int segments, int rings,
                       const std::function<Eigen::Vector3d(double, double)>& place) {
  Mesh mesh;
  mesh.positions_m.resize((rings + 1) * segments, 3);
  mesh.triangles.resize(2 * rings * segments, 3);
  int t = 0;
  for (int i = 0; i <= rings; ++i) {
    for (int j = 0; j < segments; ++j) {
      const double latitude = std::numbers::pi * (static_cast<double>(i) / rings - 0.5);
      mesh.positions_m.row(i * segments + j) =
          place(2.0 * std::numbers::pi * j / segments, latitude);
      if (i == rings) continue;
      const int a = i * segments + j, b = i * segments + (j + 1) % segments;
      mesh.triangles.row(t++) << a, b, b + segments;
      mesh.triangles.row(t++) << a, b + segments, a + segments;
    }
  }
  return mesh;
}

}  // namespace semblance::testing
