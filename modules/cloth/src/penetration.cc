#include "penetration.h"

#include <embree3/rtcore.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>

#include "crossing.h"
#include "semblance/core/errors.h"
#include "semblance/core/parallel.h"

namespace semblance {
namespace {

using Eigen::Vector3d;
using Kind = Penetration::Kind;
using TrianglePair = std::pair<int, int>;

/// A surface as both ways of searching see it.
struct Surface {
  const Points& positions_m;
  const Triangles& triangles;
};

/// Triangles in an Embree scene, as boxes: rtcCollide takes nothing else.
class CollisionScene {
 public:
  CollisionScene(RTCDevice device, const Surface& surface) : surface_(surface) {
    scene_ = rtcNewScene(device);
    const RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
    rtcSetGeometryUserPrimitiveCount(geometry, static_cast<unsigned>(surface.triangles.rows()));
    rtcSetGeometryUserData(geometry, this);
    rtcSetGeometryBoundsFunction(geometry, bounds, nullptr);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene_);
  }
  ~CollisionScene() { rtcReleaseScene(scene_); }
  CollisionScene(const CollisionScene&) = delete;
  CollisionScene& operator=(const CollisionScene&) = delete;

  /// Pairs of triangles, one of each, whose boxes meet; sorted.
  std::vector<TrianglePair> pairs_with(CollisionScene& other) {
    found_.clear();
    rtcCollide(scene_, other.scene_, keep, this);
    std::sort(found_.begin(), found_.end());
    found_.erase(std::unique(found_.begin(), found_.end()), found_.end());
    return std::move(found_);
  }

 private:
  static void bounds(const RTCBoundsFunctionArguments* arguments) {
    const Surface& surface = static_cast<CollisionScene*>(arguments->geometryUserPtr)->surface_;
    const auto corners = surface.triangles.row(arguments->primID);
    float lower[3], upper[3];
    for (int k = 0; k < 3; ++k) {
      const double a = surface.positions_m(corners[0], k), b = surface.positions_m(corners[1], k),
                   c = surface.positions_m(corners[2], k);
      constexpr float infinity = std::numeric_limits<float>::infinity();
      lower[k] = std::nextafter(static_cast<float>(std::min({a, b, c})), -infinity);
      upper[k] = std::nextafter(static_cast<float>(std::max({a, b, c})), infinity);
    }
    RTCBounds& box = *arguments->bounds_o;
    box.lower_x = lower[0], box.lower_y = lower[1], box.lower_z = lower[2];
    box.upper_x = upper[0], box.upper_y = upper[1], box.upper_z = upper[2];
  }
  static void keep(void* self, RTCCollision* collisions, unsigned count) {
    auto* scene = static_cast<CollisionScene*>(self);
    const std::lock_guard lock(scene->mutex_);  // Embree calls from several threads
    for (unsigned i = 0; i < count; ++i)
      scene->found_.emplace_back(collisions[i].primID0, collisions[i].primID1);
  }

  Surface surface_;
  RTCScene scene_;
  std::mutex mutex_;
  std::vector<TrianglePair> found_;
};

class EmbreeDevice {
 public:
  EmbreeDevice() : device_(rtcNewDevice(nullptr)) {
    if (device_ == nullptr) throw SolverError("Embree gives no device on this machine");
  }
  ~EmbreeDevice() { rtcReleaseDevice(device_); }
  EmbreeDevice(const EmbreeDevice&) = delete;
  EmbreeDevice& operator=(const EmbreeDevice&) = delete;
  operator RTCDevice() const { return device_; }

 private:
  RTCDevice device_;
};

void add_if_crossing(Kind kind, int obstacle, const std::array<int, 2>& edge, const Points& of_edge,
                     const Surface& surface, int triangle, std::vector<Penetration>& found) {
  const auto corners = surface.triangles.row(triangle);
  if (segment_meets_triangle(
          of_edge.row(edge[0]), of_edge.row(edge[1]), surface.positions_m.row(corners[0]),
          surface.positions_m.row(corners[1]), surface.positions_m.row(corners[2])))
    found.push_back({kind, obstacle, edge, {corners[0], corners[1], corners[2]}, 0.0});
}

bool has_vertex(const Triangles& triangles, int t, int v) {
  return triangles(t, 0) == v || triangles(t, 1) == v || triangles(t, 2) == v;
}

/// Edge e of the cloth and triangle t of it, unless they share a vertex.
void add_own(const SurfaceTopology& cloth, const Surface& surface, int e, int t,
             std::vector<Penetration>& found) {
  const std::array<int, 2> edge = cloth.edges[e];
  if (!has_vertex(cloth.triangles, t, edge[0]) && !has_vertex(cloth.triangles, t, edge[1]))
    add_if_crossing(Kind::cloth_edge_cloth_triangle, -1, edge, surface.positions_m, surface, t,
                    found);
}

/// Runs add(i, found) for all i, in parallel, and joins what they find.
template <typename Add>
void gather(std::size_t count, const Add& add, std::vector<Penetration>& found) {
  constexpr std::size_t chunk = 256;
  std::vector<std::vector<Penetration>> of_chunk((count + chunk - 1) / chunk);
  parallel_for(of_chunk.size(), [&](std::size_t c) {
    for (std::size_t i = c * chunk; i < std::min(count, (c + 1) * chunk); ++i) add(i, of_chunk[c]);
  });
  for (const auto& some : of_chunk) found.insert(found.end(), some.begin(), some.end());
}

void own_by_brute_force(const SurfaceTopology& cloth, const Surface& surface,
                        std::vector<Penetration>& found) {
  gather(
      cloth.edges.size(),
      [&](std::size_t e, std::vector<Penetration>& out) {
        for (int t = 0; t < surface.triangles.rows(); ++t)
          add_own(cloth, surface, static_cast<int>(e), t, out);
      },
      found);
}

void own_by_tree(const SurfaceTopology& cloth, const Surface& surface, CollisionScene& scene,
                 std::vector<Penetration>& found) {
  const std::vector<TrianglePair> pairs = scene.pairs_with(scene);
  gather(
      pairs.size(),
      [&](std::size_t i, std::vector<Penetration>& out) {
        const auto [a, b] = pairs[i];
        const auto edges_of = [&](int from, int t) {
          const SurfaceTopology::Owned& owned = cloth.owned[from];
          for (int k = 0; k < owned.edge_count; ++k)
            add_own(cloth, surface, owned.edges[k], t, out);
        };
        // A scene against itself may name a pair once or both ways round; doubles are removed.
        edges_of(a, b);
        edges_of(b, a);
      },
      found);
}

void others_by_brute_force(const SurfaceTopology& cloth, const Surface& surface, int o,
                           const PlacedObstacle& obstacle, const Surface& other,
                           std::vector<Penetration>& found) {
  gather(
      cloth.edges.size(),
      [&](std::size_t e, std::vector<Penetration>& out) {
        for (int t = 0; t < other.triangles.rows(); ++t)
          add_if_crossing(Kind::cloth_edge_obstacle_triangle, o, cloth.edges[e],
                          surface.positions_m, other, t, out);
      },
      found);
  gather(
      obstacle.edges().size(),
      [&](std::size_t e, std::vector<Penetration>& out) {
        for (int t = 0; t < surface.triangles.rows(); ++t)
          add_if_crossing(Kind::obstacle_edge_cloth_triangle, o, obstacle.edges()[e],
                          other.positions_m, surface, t, out);
      },
      found);
}

/// Sides of a triangle of an obstacle that are its edges: of a solid not the diagonals of faces.
void obstacle_edges_on(const PlacedObstacle& obstacle, int o, const Surface& surface,
                       const Surface& other, int of_obstacle, int of_cloth,
                       std::vector<Penetration>& out) {
  for (int k = 0; k < 3; ++k) {
    const int a = other.triangles(of_obstacle, k), b = other.triangles(of_obstacle, (k + 1) % 3);
    const std::array<int, 2> edge{std::min(a, b), std::max(a, b)};
    if (obstacle.has_edge(edge))
      add_if_crossing(Kind::obstacle_edge_cloth_triangle, o, edge, other.positions_m, surface,
                      of_cloth, out);
  }
}

void others_by_tree(const SurfaceTopology& cloth, const Surface& surface, CollisionScene& scene,
                    RTCDevice device, int o, const PlacedObstacle& obstacle, const Surface& other,
                    std::vector<Penetration>& found) {
  CollisionScene other_scene(device, other);
  const std::vector<TrianglePair> pairs = scene.pairs_with(other_scene);
  gather(
      pairs.size(),
      [&](std::size_t i, std::vector<Penetration>& out) {
        const auto [a, b] = pairs[i];
        const SurfaceTopology::Owned& owned = cloth.owned[a];
        for (int k = 0; k < owned.edge_count; ++k)
          add_if_crossing(Kind::cloth_edge_obstacle_triangle, o, cloth.edges[owned.edges[k]],
                          surface.positions_m, other, b, out);
        obstacle_edges_on(obstacle, o, surface, other, b, a, out);
      },
      found);
}

void vertices_inside(const PlacedObstacle& obstacle, int o, const Points& x,
                     std::vector<Penetration>& found) {
  gather(
      x.rows(),
      [&](std::size_t v, std::vector<Penetration>& out) {
        const double distance_m = obstacle.closest(x.row(static_cast<Eigen::Index>(v))).distance_m;
        if (distance_m < 0.0)
          out.push_back(
              {Kind::vertex_inside, o, {static_cast<int>(v), -1}, {-1, -1, -1}, -distance_m});
      },
      found);
}

}  // namespace

std::vector<Penetration> find_penetrations(const SurfaceTopology& cloth,
                                           const std::vector<PlacedObstacle>& obstacles,
                                           const Points& positions_m, bool with_itself,
                                           bool brute_force) {
  std::vector<Penetration> found;
  const Surface surface{positions_m, cloth.triangles};
  const EmbreeDevice device;
  CollisionScene scene(device, surface);
  if (with_itself && brute_force) own_by_brute_force(cloth, surface, found);
  if (with_itself && !brute_force) own_by_tree(cloth, surface, scene, found);
  for (int o = 0; o < static_cast<int>(obstacles.size()); ++o) {
    const PlacedObstacle& obstacle = obstacles[o];
    const Surface other{obstacle.corners(), obstacle.faces()};
    if (obstacle.is_solid()) vertices_inside(obstacle, o, positions_m, found);
    if (brute_force) {
      others_by_brute_force(cloth, surface, o, obstacle, other, found);
    } else if (other.triangles.rows() > 0) {
      others_by_tree(cloth, surface, scene, device, o, obstacle, other, found);
    }
  }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

std::string describe(const Penetration& first, const std::vector<PlacedObstacle>& obstacles,
                     std::size_t count) {
  const auto names = [](const auto& vertices) {
    std::string text;
    for (const int v : vertices) text += (text.empty() ? "" : ", ") + std::to_string(v + 1);
    return text;
  };
  const std::string name =
      first.obstacle < 0 ? "" : '"' + obstacles[first.obstacle].obstacle().name + '"';
  std::string text;
  switch (first.kind) {
    case Kind::vertex_inside:
      text = "vertex " + std::to_string(first.edge[0] + 1) + " of the cloth is inside " + name +
             ", " + std::to_string(1e3 * first.depth_m) + " mm deep";
      break;
    case Kind::cloth_edge_cloth_triangle:
      text = "the cloth crosses itself: edge (" + names(first.edge) + ") and triangle (" +
             names(first.triangle) + ")";
      break;
    case Kind::cloth_edge_obstacle_triangle:
      text = "edge (" + names(first.edge) + ") of the cloth crosses " + name;
      break;
    case Kind::obstacle_edge_cloth_triangle:
      text = "triangle (" + names(first.triangle) + ") of the cloth crosses an edge of " + name;
      break;
  }
  if (count > 1) text += " (and " + std::to_string(count - 1) + " more)";
  return text;
}

}  // namespace semblance
