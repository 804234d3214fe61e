#include "semblance/core/mesh.h"

#include <fmt/format.h>

#include <cmath>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

void check_positions(const Mesh& mesh, const std::string& source) {
  for (Eigen::Index i = 0; i < mesh.vertex_count(); ++i) {
    if (mesh.positions_m.row(i).allFinite()) continue;
    throw InvalidInput(fmt::format(
        "{}: the position of vertex {} (counted from 0) is ({}, {}, {}); every coordinate must be "
        "finite. Repair the vertex in the program that wrote the mesh",
        source, i, mesh.positions_m(i, 0), mesh.positions_m(i, 1), mesh.positions_m(i, 2)));
  }
}

void check_triangles(const Mesh& mesh, const std::string& source) {
  for (Eigen::Index i = 0; i < mesh.triangle_count(); ++i) {
    const int a = mesh.triangles(i, 0), b = mesh.triangles(i, 1), c = mesh.triangles(i, 2);
    for (const int vertex : {a, b, c}) {
      if (vertex >= 0 && vertex < mesh.vertex_count()) continue;
      throw InvalidInput(fmt::format(
          "{}: triangle {} (counted from 0) names vertex {}; there are {} vertices, so indices "
          "must lie in 0 to {}",
          source, i, vertex, mesh.vertex_count(), mesh.vertex_count() - 1));
    }
    if (a == b || b == c || c == a) {
      throw InvalidInput(fmt::format(
          "{}: triangle {} (counted from 0) uses a vertex twice ({}, {}, {}); remove degenerate "
          "triangles",
          source, i, a, b, c));
    }
  }
}

}  // namespace

void validate(const Mesh& mesh, const std::string& source) {
  check_positions(mesh, source);
  check_triangles(mesh, source);
  if (mesh.uvs.rows() != 0 && mesh.uvs.rows() != mesh.vertex_count()) {
    throw InvalidInput(fmt::format(
        "{}: there are {} texture coordinates for {} vertices; give none, or one per vertex",
        source, mesh.uvs.rows(), mesh.vertex_count()));
  }
  if (!mesh.uvs.allFinite()) {
    throw InvalidInput(fmt::format("{}: a texture coordinate is not finite", source));
  }
}

void vertex_normals(const PointsF& positions_m,
                    const Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>& triangles,
                    PointsF& normals) {
  normals.setZero(positions_m.rows(), 3);
  const float* const p = positions_m.data();
  float* const n = normals.data();
  const int* t = triangles.data();
  // The cross product's length is twice the area, which is the weight wanted.
  for (Eigen::Index i = 0; i < triangles.rows(); ++i, t += 3) {
    const float* const a = p + 3 * static_cast<std::ptrdiff_t>(t[0]);
    const float* const b = p + 3 * static_cast<std::ptrdiff_t>(t[1]);
    const float* const c = p + 3 * static_cast<std::ptrdiff_t>(t[2]);
    const float ux = b[0] - a[0], uy = b[1] - a[1], uz = b[2] - a[2];
    const float vx = c[0] - a[0], vy = c[1] - a[1], vz = c[2] - a[2];
    const float x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
    for (int k = 0; k < 3; ++k) {
      float* const sum = n + 3 * static_cast<std::ptrdiff_t>(t[k]);
      sum[0] += x;
      sum[1] += y;
      sum[2] += z;
    }
  }
  for (Eigen::Index i = 0; i < normals.rows(); ++i) {
    float* const row = n + 3 * i;
    const float squared = row[0] * row[0] + row[1] * row[1] + row[2] * row[2];
    const float scale = squared > 1e-36f ? 1.0f / std::sqrt(squared) : 0.0f;
    row[0] *= scale;
    row[1] *= scale;
    row[2] *= scale;
  }
}

}  // namespace semblance
