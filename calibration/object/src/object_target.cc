#include "semblance/object/object_target.h"

#include <algorithm>
#include <array>
#include <bit>
#include <map>
#include <utility>
#include <vector>

#include "semblance/core/errors.h"
#include "semblance/cost/texture_atlas.h"

namespace semblance {
namespace {

using Triangles = SurfaceTopology::Triangles;

constexpr double kLongestEdge = 1.0 / 40.0;  // of the diagonal of the mesh's box
constexpr Eigen::Index kMostTriangles = 400'000;
constexpr int kSmallestTexture = 64, kLargestTexture = 2048;

/// For each vertex the first one at the same place.
std::vector<int> first_at_place(const Mesh& mesh) {
  std::map<std::array<double, 3>, int> first;
  std::vector<int> result;
  for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v) {
    const std::array<double, 3> place{mesh.positions_m(v, 0), mesh.positions_m(v, 1),
                                      mesh.positions_m(v, 2)};
    result.push_back(first.emplace(place, static_cast<int>(v)).first->second);
  }
  return result;
}

Triangles welded_triangles(const Mesh& mesh) {
  const std::vector<int> first = first_at_place(mesh);
  return mesh.triangles.unaryExpr([&](int v) { return first[static_cast<std::size_t>(v)]; });
}

/// Leaves out triangles whose corners are not three places.
void drop_degenerate(Mesh& mesh) {
  const Triangles welded = welded_triangles(mesh);
  Eigen::Index kept = 0;
  for (Eigen::Index t = 0; t < welded.rows(); ++t) {
    const auto c = welded.row(t);
    if (c[0] == c[1] || c[1] == c[2] || c[2] == c[0]) continue;
    mesh.triangles.row(kept++) = mesh.triangles.row(t).eval();
  }
  mesh.triangles.conservativeResize(kept, 3);
}

/// One pass of halving edges that are too long. Both triangles at an edge halve it alike, so no
/// cracks open.
class EdgeDivision {
 public:
  EdgeDivision(Mesh& mesh, double longest_m) : mesh_(mesh), longest_m_(longest_m) {}

  bool run() {
    for (Eigen::Index t = 0; t < mesh_.triangle_count(); ++t) divide(mesh_.triangles.row(t).eval());
    const bool changed = !middles_.empty();
    append_vertices();
    mesh_.triangles.resize(static_cast<Eigen::Index>(out_.size()), 3);
    for (std::size_t t = 0; t < out_.size(); ++t) {
      mesh_.triangles.row(static_cast<Eigen::Index>(t)) << out_[t][0], out_[t][1], out_[t][2];
    }
    return changed;
  }

 private:
  /// The vertex in the middle of an edge; -1 where the edge is short enough.
  int middle(int a, int b) {
    if ((mesh_.positions_m.row(a) - mesh_.positions_m.row(b)).norm() <= longest_m_) return -1;
    const auto next = static_cast<int>(mesh_.vertex_count() + std::ssize(middles_));
    const auto found = index_.emplace(std::minmax(a, b), next);
    if (found.second) middles_.emplace_back(a, b);
    return found.first->second;
  }

  void divide(const Eigen::RowVector3i& corner) {
    std::array<int, 3> between{};
    for (int k = 0; k < 3; ++k) between[k] = middle(corner[k], corner[(k + 1) % 3]);
    const auto count = std::count_if(between.begin(), between.end(), [](int m) { return m >= 0; });
    // Turned so that the first edge is divided; of two, that the third is not.
    int k = 0;
    while (count == 1 && between[k] < 0) ++k;
    while (count == 2 && between[(k + 2) % 3] >= 0) ++k;
    const int a = corner[k % 3], b = corner[(k + 1) % 3], c = corner[(k + 2) % 3];
    const int ab = between[k % 3], bc = between[(k + 1) % 3], ca = between[(k + 2) % 3];
    if (count == 0) {
      out_.push_back({a, b, c});
    } else if (count == 1) {
      out_.insert(out_.end(), {{a, ab, c}, {ab, b, c}});
    } else if (count == 2) {
      out_.insert(out_.end(), {{a, ab, c}, {ab, bc, c}, {ab, b, bc}});
    } else {
      out_.insert(out_.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
  }

  void append_vertices() {
    const Eigen::Index before = mesh_.vertex_count();
    const auto more = static_cast<Eigen::Index>(middles_.size());
    const bool with_uvs = mesh_.uvs.rows() > 0;
    mesh_.positions_m.conservativeResize(before + more, 3);
    if (with_uvs) mesh_.uvs.conservativeResize(before + more, 2);
    for (Eigen::Index i = 0; i < more; ++i) {
      const auto [a, b] = middles_[static_cast<std::size_t>(i)];
      mesh_.positions_m.row(before + i) =
          0.5 * (mesh_.positions_m.row(a) + mesh_.positions_m.row(b));
      if (with_uvs) mesh_.uvs.row(before + i) = 0.5f * (mesh_.uvs.row(a) + mesh_.uvs.row(b));
    }
  }

  Mesh& mesh_;
  double longest_m_;
  std::map<std::pair<int, int>, int> index_;
  std::vector<std::pair<int, int>> middles_;
  std::vector<std::array<int, 3>> out_;
};

/// Six times the volume that the triangles enclose; positive where they turn outwards.
double signed_volume(const Mesh& mesh) {
  double sum = 0.0;
  for (Eigen::Index t = 0; t < mesh.triangle_count(); ++t) {
    const auto corner = mesh.triangles.row(t);
    const Eigen::Vector3d a = mesh.positions_m.row(corner[0]), b = mesh.positions_m.row(corner[1]),
                          c = mesh.positions_m.row(corner[2]);
    sum += a.dot(b.cross(c));
  }
  return sum;
}

PointsF shared_normals(const Mesh& mesh, const Triangles& welded) {
  PointsF normals;
  vertex_normals(mesh.positions_m.cast<float>(), welded, normals);
  const std::vector<int> first = first_at_place(mesh);
  for (std::size_t v = 0; v < first.size(); ++v) {
    normals.row(static_cast<Eigen::Index>(v)) = normals.row(first[v]).eval();
  }
  return normals;
}

Appearance textured_appearance(const Mesh& mesh, const Image& texture) {
  const int longest = std::max(texture.width, texture.height);
  const int size = std::clamp(static_cast<int>(std::bit_ceil(static_cast<unsigned>(longest))),
                              kSmallestTexture, kLargestTexture);
  const auto count = static_cast<std::size_t>(mesh.vertex_count());
  Appearance appearance(mesh, size, PointsF::Zero(mesh.vertex_count(), 3),
                        std::vector<float>(count, 0.0f));
  // A texture finer than ours is averaged first.
  Image source = texture;
  while (source.width >= 2 * size || source.height >= 2 * size) source = downsample_half(source);
  const TextureAtlas atlas = make_texture_atlas(mesh, size, size);
  std::vector<float>& state = appearance.state();
  for (std::size_t i = 0; i < atlas.size(); ++i) {
    const auto row = static_cast<float>(atlas.texel[i] / size),
               column = static_cast<float>(atlas.texel[i] % size);
    float colour[3];
    sample_bilinear(source, (column + 0.5f) * static_cast<float>(source.width) / size,
                    (row + 0.5f) * static_cast<float>(source.height) / size, colour);
    for (int c = 0; c < 3; ++c) state[4 * i + c] = encode_intensity(colour[c]);
    state[4 * i + 3] = 1.0f;
  }
  appearance.rebuild();
  return appearance;
}

void check_mesh(const Mesh& mesh, const Image& texture, const std::string& source) {
  validate(mesh, source);
  if (mesh.triangle_count() == 0) throw InvalidInput(source + ": the mesh has no triangles");
  if (!texture.empty() && mesh.uvs.rows() == 0) {
    throw InvalidInput(source +
                       ": the mesh has no texture coordinates, so a texture cannot be laid on it; "
                       "leave the texture out, or export the mesh with them");
  }
}

}  // namespace

ObjectTarget make_object_target(Mesh mesh, const Image& texture, const std::string& source) {
  check_mesh(mesh, texture, source);
  drop_degenerate(mesh);
  const Eigen::RowVector3d lower = mesh.positions_m.colwise().minCoeff(),
                           upper = mesh.positions_m.colwise().maxCoeff();
  const Eigen::RowVector3d centre = 0.5 * (lower + upper);
  const double size_m = (upper - lower).norm();
  mesh.positions_m.rowwise() -= centre;
  if (signed_volume(mesh) < 0.0) {
    throw InvalidInput(source +
                       ": the mesh is inside out (its triangles turn clockwise seen from outside); "
                       "flip its faces in a mesh editor");
  }
  while (mesh.triangle_count() < kMostTriangles &&
         EdgeDivision(mesh, kLongestEdge * size_m).run()) {
  }
  if (mesh.uvs.rows() == 0) mesh.uvs.setZero(mesh.vertex_count(), 2);
  const Triangles welded = welded_triangles(mesh);
  ObjectTarget target{.mesh = std::move(mesh),
                      .centre_m = centre.transpose(),
                      .size_m = size_m,
                      .normals = {},
                      .topology = SurfaceTopology(Triangles(0, 3)),
                      .welded = SurfaceTopology(welded),
                      .appearance = std::nullopt};
  target.topology = SurfaceTopology(target.mesh.triangles);
  target.normals = shared_normals(target.mesh, welded);
  if (!texture.empty()) target.appearance = textured_appearance(target.mesh, texture);
  return target;
}

}  // namespace semblance
