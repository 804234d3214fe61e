// Where cloth touches itself and other bodies, and how far it may move before it passes through.
//
// Method: Li et al., Incremental Potential Contact (SIGGRAPH 2020) and Codimensional Incremental
// Potential Contact (SIGGRAPH 2021): every pair of a vertex and a triangle, or of two edges, keeps
// a positive gap; a barrier on gaps gives the forces, and no step is longer than the gaps allow.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "semblance/cloth/obstacle.h"
#include "semblance/cloth/points.h"

namespace semblance {

/// What meets what. "Second" is the side that normals point away from.
enum class ContactKind : std::uint8_t {
  vertex_triangle,  // cloth, cloth
  edge_edge,        // cloth, cloth
  vertex_solid,     // vertex of the cloth, closest point of a solid
  edge_solid_edge,  // edge of the cloth, edge of a solid's core
  triangle_corner,  // triangle of the cloth, corner of a solid's core or of a mesh
  vertex_mesh,      // vertex of the cloth, triangle of a mesh
  edge_mesh_edge,   // edge of the cloth, edge of a mesh
};

/// One gap that is smaller than its reach. With r = sum_i weight_i x_{vertex_i} - obstacle_point_m,
///     gap_m = |r| - offset,   d gap / d x_{vertex_i} = weight_i normal^T
/// where offset is the thickness that surfaces keep. Weights and obstacle_point_m belong to closest
/// points: they may be held while a gap is differentiated once (envelope theorem).
struct Contact {
  std::array<int, 4> vertex{-1, -1, -1, -1};  // of the cloth; -1: unused
  std::array<double, 4> weight{};             // 1 in sum against obstacles, 0 in self-contact
  Eigen::Vector3d normal;                     // r / |r|: unit, from the second side to the first
  double gap_m = 0.0;                         // positive unless surfaces have crossed
  double reach_m = 0.0;                       // the barrier's: ContactOptions::reach_m or less
  /// Weight of the barrier: the pair's energy is area_m2 * barrier(gap_m, reach_m, p0).energy.
  /// Sums of it do not change when the mesh is refined (ContactOptions).
  double area_m2 = 0.0;
  Eigen::Vector3d obstacle_point_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d obstacle_velocity_m_s = Eigen::Vector3d::Zero();  // of that point
  int obstacle = -1;                                                // -1: self-contact
  ContactKind kind = ContactKind::vertex_triangle;
  /// Names the pair: equal in all steps for the same elements, so that friction can follow it.
  std::uint64_t key = 0;
};

/// The cloth's surface as contact needs it. Topology and rest shape do not change.
struct ContactSurface {
  Points rest_positions_m;
  Triangles triangles;
  Eigen::VectorXd vertex_area_m2;  // empty: a third of the rest areas of the triangles around
};

/// Areas of contacts. A vertex on a solid: its cloth area, so pressures add to the weight of what
/// lies there. Two layers of cloth: a quarter of a vertex's area, and 0.2 sqrt(a_1 a_2) for two
/// edges with a third of the areas of the triangles beside them; two flat layers then sum to their
/// common area (half from vertices, half from edges that cross; random directions, square grid
/// split into triangles). Edge of cloth on an edge of a solid: 4 reach sqrt(a), which sums to the
/// length of the solid's edge times 5 reach; a corner: 25 reach squared. There cloth pulls on a
/// line or a point, and with less it would come so near that steps have to be tiny. Pairs of nearly
/// parallel edges (sin^2 < 1e-3) fade out smoothly, since their closest points jump; corners hold
/// them.
struct ContactOptions {
  double reach_m = 1e-3;     // gaps below it are contacts (d_hat)
  double thickness_m = 0.0;  // of the cloth: layers keep it, solids keep half of it
  bool self_contact = true;
  double kept_gap = 0.1;  // fraction of a gap that a step leaves at least
};

/// Crossing or inclusion found by penetrations().
struct Penetration {
  enum class Kind : std::uint8_t {
    vertex_inside,  // a vertex of the cloth in a solid: edge[0]
    cloth_edge_cloth_triangle,
    cloth_edge_obstacle_triangle,
    obstacle_edge_cloth_triangle,
  };
  Kind kind;
  int obstacle = -1;                        // -1: self
  std::array<int, 2> edge{-1, -1};          // its vertices
  std::array<int, 3> triangle{-1, -1, -1};  // its vertices
  double depth_m = 0.0;                     // of a vertex inside
  auto operator<=>(const Penetration&) const = default;
};

/// Finds contacts of one sheet with itself and with obstacles. Not to be used from two threads at
/// once; works on several itself, and results do not depend on their number.
///
///     ContactFinder finder(surface, obstacles, options);
///     finder.update(x, time_s);                     // at the start and after every move
///     for (const Contact& c : finder.contacts(x)) ...
///     x += finder.max_step(x, dx) * dx;
///     finder.update(x);
class ContactFinder {
 public:
  /// Throws InvalidInput on meshes or options that cannot be used.
  ContactFinder(const ContactSurface& surface, std::vector<Obstacle> obstacles,
                const ContactOptions& options);
  ~ContactFinder();
  ContactFinder(ContactFinder&&) noexcept;
  ContactFinder& operator=(ContactFinder&&) noexcept;

  /// Puts obstacles where they are at `time_s`, without a look at what is in their way (see
  /// max_step_until), and prepares for cloth at `positions_m`. Near pairs are gathered anew only if
  /// something has moved far enough since it was done last.
  void update(const Points& positions_m, double time_s);
  /// The same with obstacles left where they are.
  void update(const Points& positions_m);

  /// All gaps below their reach, ordered by kind and elements. Positions must be those of the last
  /// update. The reference holds until the next call.
  const std::vector<Contact>& contacts(const Points& positions_m);

  /// Largest fraction in (0, 1] of `displacement_m` for which every gap stays positive all the way:
  /// at least kept_gap of what it is now. Obstacles are at rest. Conservative advancement with a
  /// plane between the two parts of a pair; see the source for the bound.
  double max_step(const Points& positions_m, const Points& displacement_m);

  /// The same for each vertex on its own: any fractions up to these, chosen vertex by vertex, keep
  /// every gap positive. A tight contact then stops its own vertices and not the sheet. Each
  /// single fraction may be smaller than max_step's, as it reckons with all choices of others.
  void max_vertex_steps(const Points& positions_m, const Points& displacement_m,
                        Eigen::VectorXd& fractions);

  /// Largest fraction of a step in which the cloth moves by `displacement_m` and, at the same time,
  /// obstacles move to where they are at `time_s`. To take it, add fraction * displacement_m and
  /// call move_obstacles(time_s, fraction), then update(positions).
  double max_step_until(const Points& positions_m, const Points& displacement_m, double time_s);
  /// Moves obstacles by a fraction of the way from where they are to where they are at `time_s`:
  /// vertices of meshes in a straight line, solids by a straight line of their origin and a turn
  /// of constant speed.
  void move_obstacles(double time_s, double fraction);

  /// Edges of the cloth, each once, its vertices in order; areas as in ContactOptions.
  const std::vector<std::array<int, 2>>& edges() const;
  const std::vector<Obstacle>& obstacles() const;
  /// Surfaces of the obstacles as they stand: of solids the core's faces.
  const Points& obstacle_positions(int obstacle) const;

  /// Everything that crosses: edges of cloth or obstacle and triangles of the other (touching
  /// counts), and vertices inside solids. Exact for the given positions (signs of determinants are
  /// evaluated with as many digits as they need) and independent of contacts() and max_step().
  /// Sorted. `brute_force` tries all pairs, for tests.
  std::vector<Penetration> penetrations(const Points& positions_m, bool brute_force = false) const;

  /// Moves vertices of cloth that cuts solids, or is nearer to them than the thickness, along the
  /// solids' normals, by `stride_m` and again until it is clear, at most thirty times. Cloth that
  /// cuts itself, or meshes, stays as it is. Returns the longest move.
  double push_out(Points& positions_m, double stride_m);

  /// Nothing if cloth at `positions_m` can be simulated from there; else a sentence that names the
  /// obstacle and the first vertex or triangle that crosses, or is nearer than the thickness.
  std::optional<std::string> start_problem(const Points& positions_m);

  /// What has been done since construction, to judge speed.
  struct Statistics {
    std::int64_t rebuilds = 0;        // gatherings of near pairs
    std::int64_t swept_searches = 0;  // steps longer than the gathered pairs cover
    std::int64_t candidates = 0;      // near pairs at present
    double margin_m = 0.0;            // beyond reach, at present
  };
  Statistics statistics() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace semblance
