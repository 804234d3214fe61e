// Bodies that cloth touches.
#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "semblance/cloth/points.h"
#include "semblance/core/mesh.h"
#include "semblance/core/rigid3.h"
#include "semblance/geometry/skinned_mesh.h"

namespace semblance {

/// Point of a surface closest to a given one.
struct SurfacePoint {
  double distance_m;        // negative inside
  Eigen::Vector3d point_m;  // on the surface
  Eigen::Vector3d normal;   // unit, outwards
};

/// A convex body whose distance is known in closed form: a polyhedron (the core, which may be as
/// little as a segment or a point) and everything within `rounding_m` of it. A vertex of cloth
/// touches it at one point, found by `closest`. That alone would let an edge of the cloth cut
/// through an edge of the body between two vertices, so edges and corners of the core are listed
/// too and meet edges and triangles of the cloth. Coordinates are those of the body.
class Solid {
 public:
  virtual ~Solid() = default;
  /// Of the surface with its rounding.
  virtual SurfacePoint closest(const Eigen::Vector3d& point_m) const = 0;
  /// Its look, outward triangles; rounded edges as arcs.
  virtual Mesh mesh() const = 0;

  double rounding_m = 0.0;
  Points corners_m;                       // of the core; none for a plane
  std::vector<std::array<int, 2>> edges;  // of the core: corners, smaller first; sorted
  Triangles faces;                        // of the core, outward; none for a segment or point
};

/// Place of a body at a time: world_from_body.
using RigidMotion = std::function<Rigid3(double time_s)>;
/// Places of a mesh's vertices at a time, in the world; the rows are there already.
using VertexMotion = std::function<void(double time_s, Points& positions_m)>;

/// One body, at rest or moving: a Solid moved rigidly, or else a triangle mesh, moved rigidly or
/// vertex by vertex (scan or animation: `vertex_frames`). Cheap to copy.
struct Obstacle {
  std::string name;                     // for messages
  std::shared_ptr<const Solid> solid;   // null: `mesh` is the body
  std::shared_ptr<const Mesh> surface;  // null where `solid` is given
  RigidMotion world_from_body;          // null: at rest, body and world coincide
  VertexMotion vertices;                // of a mesh: takes precedence over world_from_body
};

/// Whether it is ever elsewhere than at 0 s: looked for every 20 ms of the first 100 s.
bool is_moving(const Obstacle& obstacle);

/// All points below the plane through `point_m`; `normal` points out of the body.
Obstacle make_plane(const std::string& name, const Eigen::Vector3d& point_m,
                    const Eigen::Vector3d& normal);

/// Box of full size `size_m` about the body's origin. Rounding takes `rounding_m` off its edges and
/// leaves its faces where they are; zero leaves them sharp.
Obstacle make_box(const std::string& name, const Eigen::Vector3d& size_m,
                  const Rigid3& world_from_body = {}, double rounding_m = 0.0);

/// Regular prism of `sides` sides, inscribed in the upright cylinder of that radius about the
/// body's y axis, centred at the body's origin.
Obstacle make_prism(const std::string& name, double radius_m, double height_m, int sides,
                    const Rigid3& world_from_body = {}, double rounding_m = 0.0);

/// Cusick's drape tester: a horizontal disc whose upper face is at the height of `top_centre_m`,
/// and the stem that carries it, as two bodies. Both are prisms of `sides` sides, so the rim is a
/// fine polygon: with 128 it is at most 0.03 % of the radius inside the circle.
struct DrapeTester {
  double disc_radius_m = 0.09, disc_thickness_m = 0.005;
  double stem_radius_m = 0.01, stem_length_m = 0.3;
  int sides = 128;
  double rounding_m = 0.0;
};
std::vector<Obstacle> make_drape_tester(const std::string& name,
                                        const Eigen::Vector3d& top_centre_m,
                                        const DrapeTester& tester = {});

/// Sphere about the body's origin.
Obstacle make_sphere(const std::string& name, double radius_m, const Rigid3& world_from_body = {});

/// Points within `radius_m` of a segment of that length along the body's y axis, about its origin.
Obstacle make_capsule(const std::string& name, double radius_m, double length_m,
                      const Rigid3& world_from_body = {});

/// A triangle mesh at rest. Throws InvalidInput as validate() does.
Obstacle make_mesh_obstacle(const std::string& name, Mesh mesh);

/// Linear interpolation between frames of vertices; before the first and after the last the ends
/// rest. Throws InvalidInput unless times grow and all frames have the same number of rows.
VertexMotion vertex_frames(std::vector<double> times_s, std::vector<Points> frames_m);

/// A skinned mesh without its seams, at rest where `animation` is null. Else its vertices are taken
/// `frames_per_second` times a second, and at the animation's end, go straight from one place to
/// the next, and rest behind the last. `world_from_skin` scales and places all of it. Throws
/// InvalidInput where positions are not finite, or more than 100 million.
Obstacle make_skin_obstacle(const std::string& name, const SkinnedMesh& skin,
                            const SkinAnimation* animation, double frames_per_second = 30.0,
                            const Eigen::Affine3d& world_from_skin = Eigen::Affine3d::Identity());

/// Surface of an obstacle in the world at a time, to draw it or to test with.
Mesh obstacle_mesh(const Obstacle& obstacle, double time_s);

}  // namespace semblance
