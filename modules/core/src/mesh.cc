#include "semblance/core/mesh.h"

#include <fmt/format.h>

#include <algorithm>
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

/// Adds a triangle's normal, as long as twice its area, to the sums of its corners.
void add_normal(const Float4* points, const int* corner, Float4* sums) {
  const Float4 a = points[corner[0]];
  const Float4 normal = cross(points[corner[1]] - a, points[corner[2]] - a);
  for (int k = 0; k < 3; ++k) sums[corner[k]] += normal;
}

/// What scales each of four vectors to unit length; finite for zero.
Eigen::Array4f inverse_lengths(const Float4* vectors) {
  const Float4 a = vectors[0] * vectors[0], b = vectors[1] * vectors[1];
  const Float4 c = vectors[2] * vectors[2], d = vectors[3] * vectors[3];
  const Float4 ab = __builtin_shufflevector(a, b, 0, 4, 1, 5);
  const Float4 cd = __builtin_shufflevector(c, d, 0, 4, 1, 5);
  const Float4 x = __builtin_shufflevector(ab, cd, 0, 1, 4, 5);
  const Float4 y = __builtin_shufflevector(ab, cd, 2, 3, 6, 7);
  const Float4 z = __builtin_shufflevector(__builtin_shufflevector(a, b, 2, 6, 3, 7),
                                           __builtin_shufflevector(c, d, 2, 6, 3, 7), 0, 1, 4, 5);
  const Float4 squared = x + y + z;
  Eigen::Array4f lengths;
  __builtin_memcpy(lengths.data(), &squared, sizeof squared);
  return lengths.max(1e-36f).sqrt().inverse();
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
  sums_scratch.assign(count + 4, Float4{});  // whole groups of four
  Float4* const points = points_scratch.data();
  Float4* const sums = sums_scratch.data();
  const float* p = positions_m.data();
  for (Eigen::Index i = 0; i < count; ++i, p += 3) points[i] = Float4{p[0], p[1], p[2], 0.0f};
  // Neighbours in the list share corners, and each would wait for the other's sum: two at a time,
  // from far apart.
  const Eigen::Index half = triangles.rows() / 2;
  const int* const corners = triangles.data();
  for (Eigen::Index i = 0; i < half; ++i) {
    add_normal(points, corners + 3 * i, sums);
    add_normal(points, corners + 3 * (half + i), sums);
  }
  if (triangles.rows() % 2 != 0) add_normal(points, corners + 6 * half, sums);
  normals.resize(count, 3);
  float* const n = normals.data();
  const auto write = [&](Eigen::Index i, float scale) {
    const Float4 unit = scale * sums[i];
    for (int k = 0; k < 3; ++k) n[3 * i + k] = unit[k];
  };
  Eigen::Index i = 0;
  for (; i + 4 <= count; i += 4) {
    const Eigen::Array4f scale = inverse_lengths(sums + i);
    for (int k = 0; k < 4; ++k) write(i + k, scale[k]);
  }
  const Eigen::Array4f scale = inverse_lengths(sums + i);
  for (int k = 0; i + k < count; ++k) write(i + k, scale[k]);
}

}  // namespace semblance
