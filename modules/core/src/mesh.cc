#include "semblance/core/mesh.h"

#include <fmt/format.h>

#include <cmath>
#include <vector>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

// Four lanes for three coordinates, so that every load, product and store is one instruction.
using Float4 = float __attribute__((vector_size(16)));

Float4 cross(Float4 a, Float4 b) {
  const Float4 a_yzx = __builtin_shufflevector(a, a, 1, 2, 0, 3);
  const Float4 b_yzx = __builtin_shufflevector(b, b, 1, 2, 0, 3);
  const Float4 c = a * b_yzx - a_yzx * b;
  return __builtin_shufflevector(c, c, 1, 2, 0, 3);
}

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
  // The scratch memory is kept because fresh pages would cost as much as the work.
  thread_local std::vector<Float4> points_scratch, sums_scratch;
  const Eigen::Index count = positions_m.rows();
  points_scratch.resize(count);
  sums_scratch.assign(count, Float4{});
  Float4* const points = points_scratch.data();
  Float4* const sums = sums_scratch.data();
  const float* p = positions_m.data();
  for (Eigen::Index i = 0; i < count; ++i, p += 3) points[i] = Float4{p[0], p[1], p[2], 0.0f};
  const int* t = triangles.data();
  for (Eigen::Index i = 0; i < triangles.rows(); ++i, t += 3) {
    const Float4 a = points[t[0]];
    const Float4 normal = cross(points[t[1]] - a, points[t[2]] - a);  // length: twice the area
    for (int k = 0; k < 3; ++k) sums[t[k]] += normal;
  }
  normals.resize(count, 3);
  float* n = normals.data();
  for (Eigen::Index i = 0; i < count; ++i, n += 3) {
    const Float4 sum = sums[i];
    const float squared = sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2];
    const float scale = squared > 1e-36f ? 1.0f / std::sqrt(squared) : 0.0f;
    for (int k = 0; k < 3; ++k) n[k] = scale * sum[k];
  }
}

}  // namespace semblance
