#include "semblance/cloth/contact.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>

#include "bounds_tree.h"
#include "near_pairs.h"
#include "pair_geometry.h"
#include "penetration.h"
#include "placed_obstacle.h"
#include "semblance/cloth/distance.h"
#include "semblance/core/errors.h"
#include "semblance/core/parallel.h"
#include "surface_topology.h"

namespace semblance {
namespace {

using Eigen::Vector3d;

constexpr double parallel_sin2 = 1e-3;  // edges below it fade out
constexpr int chunk_size = 1024;        // pairs that one call of a parallel loop looks at
constexpr int longest_search = 100;     // advances until a step is taken as found

/// The near pairs of one kind, sorted.
struct PairGroup {
  ContactKind kind;
  int obstacle;
  std::vector<NearPair> pairs;
};

struct Chunk {
  const PairGroup* group;
  std::size_t begin, end;
};

/// Groups that are gathered together, from positions that are their reference.
struct PairFamily {
  explicit PairFamily(bool with_obstacles) : against_obstacles(with_obstacles) {}

  bool against_obstacles;
  bool gathered = false;
  std::vector<PairGroup> groups;
  Points reference_m;
  std::vector<float> strayed_m;  // of each vertex from the reference, at the last update
  float most_strayed_m = 0.0f;
  double margin_m = 0.0;
  int updates = 0;  // since they were gathered
};

/// Vertices of the cloth in the two pieces of a pair.
struct PairVertices {
  int first_count = 0, second_count = 0;
  std::array<int, 3> first{}, second{};
};

struct Positions {
  PairPoints points;
  PairVertices vertices;
};

bool is_self(ContactKind kind) {
  return kind == ContactKind::vertex_triangle || kind == ContactKind::edge_edge;
}

std::uint64_t key_of(const PairGroup& group, const NearPair& pair) {
  const auto kind = static_cast<std::uint64_t>(group.kind) << 60;
  const auto a = static_cast<std::uint64_t>(pair.a), b = static_cast<std::uint64_t>(pair.b);
  if (group.obstacle < 0) return kind | a << 28 | b;
  return kind | static_cast<std::uint64_t>(group.obstacle) << 52 | a << 24 | b;
}

/// Factor on the area of two edges that are nearly parallel: smooth, 0 where they are (the shape of
/// the mollifier of Li et al. 2020, eq. 24). It is held while the gap is differentiated.
double parallel_factor(const PairPoints& points) {
  const Vector3d u = points.first[1] - points.first[0], v = points.second[1] - points.second[0];
  const double lengths2 = u.squaredNorm() * v.squaredNorm();
  if (!(lengths2 > 0.0)) return 0.0;
  const double share = u.cross(v).squaredNorm() / (lengths2 * parallel_sin2);
  return share < 1.0 ? share * (2.0 - share) : 1.0;
}

float upwards(double value) { return static_cast<float>(value * (1.0 + 1e-6)); }

}  // namespace

class ContactFinder::Impl {
 public:
  Impl(const ContactSurface& surface, std::vector<Obstacle> obstacles,
       const ContactOptions& options);

  void place_obstacles(double time_s) {
    for (PlacedObstacle& obstacle : placed_) obstacle.place(time_s);
  }
  void update(const Points& x);
  const std::vector<Contact>& contacts(const Points& x);
  double max_step(const Points& x, const Points& dx);
  void max_vertex_steps(const Points& x, const Points& dx, Eigen::VectorXd& fractions);
  double max_step_until(const Points& x, const Points& dx, double time_s);
  void move_obstacles(double time_s, double fraction);
  std::vector<Penetration> penetrations(const Points& x, bool brute_force) const {
    check(x);
    return find_penetrations(topology_, placed_, x, options_.self_contact, brute_force);
  }
  std::optional<std::string> start_problem(const Points& x);
  Statistics statistics() const;

  const SurfaceTopology& topology() const { return topology_; }
  const std::vector<Obstacle>& obstacles() const { return obstacles_; }
  const PlacedObstacle& placed(int obstacle) const { return placed_[obstacle]; }

 private:
  void check(const Points& x) const;
  void check_options() const;
  void make_groups();
  void find_rest_neighbours(const Points& rest);

  double offset_m(const PairGroup& group) const {
    return group.obstacle < 0 ? options_.thickness_m
                              : 0.5 * options_.thickness_m + placed_[group.obstacle].rounding_m();
  }
  float obstacle_strayed(int o, bool at_end) const;

  void measure(PairFamily& family, const Points& x);
  bool is_stale(const PairFamily& family) const;
  void gather(PairFamily& family, const Points& x);
  void adapt_margin(PairFamily& family);
  void fit_bounds(const Points& x, double inflation_m);
  void gather_self(const Points& x, double margin_m);
  void gather_against(int obstacle, const Points& x, double margin_m);
  void gather_vertices(PairGroup& group, const Points& x, double margin_m);
  void gather_features(int obstacle, const Points& x, double margin_m);
  void gather_mesh(int obstacle, const Points& x, double margin_m);
  PairGroup& group_of(std::vector<PairGroup>& groups, ContactKind kind, int obstacle);
  void collect(PairGroup& group, std::size_t task_count, int slot);
  int count_of_first(ContactKind kind) const;

  void sweep(const Points& x, const Points& dx);
  void sweep_self();
  void sweep_solid(int obstacle, const Points& x, const Points& dx);
  void sweep_mesh(int obstacle);
  void measure_path(const PairFamily& family, const Points& x, const Points& dx,
                    std::vector<float>& path) const;
  bool exceeds(const PairFamily& family, const std::vector<float>& path) const;

  void list_chunks(const std::vector<PairGroup>& groups);
  PairVertices vertices_of(const PairGroup& group, const NearPair& pair) const;
  void load(const PairGroup& group, const NearPair& pair, const Points& x, double fraction,
            const Points* dx, Positions& result) const;
  bool is_far(const PairGroup& group, const NearPair& pair, const std::vector<float>& strayed,
              bool at_end, double gap_m) const;
  void add_contact(const PairGroup& group, const NearPair& pair, const Points& x,
                   std::vector<Contact>& out) const;
  void add_solid_contact(const PairGroup& group, const NearPair& pair, const Points& x,
                         std::vector<Contact>& out) const;
  double pair_area(const PairGroup& group, const NearPair& pair, const PairPoints& points,
                   double reach_m) const;
  PairMotion motion_of(const PairGroup& group, const NearPair& pair, const PairVertices& vertices,
                       const Points& dx) const;
  double pair_step(const PairGroup& group, const NearPair& pair, const Points& x, const Points& dx,
                   double limit) const;
  double solid_step(const PairGroup& group, const NearPair& pair, const Points& x, const Points& dx,
                    double limit) const;
  double step(const Points& x, const Points& dx);
  void limit_vertices(const PairGroup& group, const NearPair& pair, const Points& x,
                      const Points& dx, std::vector<std::pair<int, double>>& limits) const;

  ContactOptions options_;
  std::vector<Obstacle> obstacles_;
  std::vector<PlacedObstacle> placed_;
  BoundsTree tree_;
  SurfaceTopology topology_;
  RestNeighbours rest_neighbours_;
  double cloth_radius_m_ = 0.0;  // about each plane's origin, for planes that turn
  double mean_edge_m_ = 0.0;
  PairFamily self_{false}, against_{true};
  std::vector<PairGroup> swept_;

  // Kept between calls for their memory.
  SurfaceBounds<Box> bounds_;
  std::vector<SurfaceBounds<Box>> mesh_bounds_;
  SurfaceBounds<SweptBox> swept_bounds_;
  SurfaceBounds<SweptBox> swept_mesh_bounds_;
  std::vector<std::array<std::vector<NearPair>, 3>> found_;  // by task
  std::vector<NearPair> scratch_;
  std::vector<int> starts_;
  std::vector<float> self_path_, against_path_;
  std::vector<float> obstacle_strayed_, obstacle_path_;
  std::vector<Chunk> chunks_;
  std::vector<std::vector<Contact>> chunk_contacts_;
  std::vector<std::vector<std::pair<int, double>>> chunk_limits_;
  std::vector<Contact> contacts_;
  Statistics statistics_;
};

namespace {

const Triangles& checked(const ContactSurface& surface) {
  Mesh mesh;
  mesh.positions_m = surface.rest_positions_m;
  mesh.triangles = surface.triangles;
  validate(mesh, "the cloth");
  if (mesh.triangle_count() == 0) throw InvalidInput("the cloth has no triangles");
  return surface.triangles;
}

}  // namespace

ContactFinder::Impl::Impl(const ContactSurface& surface, std::vector<Obstacle> obstacles,
                          const ContactOptions& options)
    : options_(options),
      obstacles_(std::move(obstacles)),
      tree_(surface.rest_positions_m, checked(surface)),
      topology_(make_topology(surface.rest_positions_m, surface.triangles, tree_.order())) {
  tree_.renumber();
  check_options();
  if (surface.vertex_area_m2.size() > 0) {
    if (surface.vertex_area_m2.size() != surface.rest_positions_m.rows())
      throw InvalidInput("the cloth has " + std::to_string(surface.rest_positions_m.rows()) +
                         " vertices but areas of " + std::to_string(surface.vertex_area_m2.size()));
    topology_.vertex_area_m2 = surface.vertex_area_m2;
  }
  placed_.reserve(obstacles_.size());
  for (const Obstacle& obstacle : obstacles_) placed_.emplace_back(obstacle);
  mesh_bounds_.resize(placed_.size());
  obstacle_strayed_.resize(placed_.size());
  obstacle_path_.resize(placed_.size());
  double sum_m = 0.0;
  for (const auto& [a, b] : topology_.edges)
    sum_m += (surface.rest_positions_m.row(a) - surface.rest_positions_m.row(b)).norm();
  mean_edge_m_ = sum_m / static_cast<double>(topology_.edges.size());
  self_.margin_m = against_.margin_m = options_.reach_m;
  make_groups();
  if (options_.self_contact) find_rest_neighbours(surface.rest_positions_m);
}

void ContactFinder::Impl::check_options() const {
  const auto refuse = [](const char* what, double value, const char* expected) {
    throw InvalidInput(std::string("contact: ") + what + " is " + std::to_string(value) +
                       ": expected " + expected);
  };
  if (!(options_.reach_m > 0.0 && std::isfinite(options_.reach_m)))
    refuse("reach_m", options_.reach_m, "more than 0");
  if (!(options_.thickness_m >= 0.0 && std::isfinite(options_.thickness_m)))
    refuse("thickness_m", options_.thickness_m, "0 or more");
  if (!(options_.kept_gap > 0.0 && options_.kept_gap <= 0.5))
    refuse("kept_gap", options_.kept_gap, "more than 0 and at most 0.5");
  if (topology_.edges.size() >= std::size_t{1} << 28)
    throw InvalidInput("the cloth has too many edges: expected fewer than 2^28");
  if (obstacles_.size() > 256) throw InvalidInput("contact: expected at most 256 obstacles");
}

void ContactFinder::Impl::make_groups() {
  if (options_.self_contact)
    self_.groups = {{ContactKind::vertex_triangle, -1, {}}, {ContactKind::edge_edge, -1, {}}};
  for (const ContactKind kind :
       {ContactKind::vertex_solid, ContactKind::edge_solid_edge, ContactKind::triangle_corner,
        ContactKind::vertex_mesh, ContactKind::edge_mesh_edge}) {
    for (int o = 0; o < static_cast<int>(placed_.size()); ++o) {
      const bool of_solid =
          kind == ContactKind::vertex_solid || kind == ContactKind::edge_solid_edge;
      const bool of_mesh = kind == ContactKind::vertex_mesh || kind == ContactKind::edge_mesh_edge;
      if (placed_[o].is_solid() ? !of_mesh : !of_solid) against_.groups.push_back({kind, o, {}});
    }
  }
  swept_ = self_.groups;
  swept_.insert(swept_.end(), against_.groups.begin(), against_.groups.end());
  for (const PlacedObstacle& obstacle : placed_)
    if (obstacle.edges().size() >= std::size_t{1} << 24)
      throw InvalidInput(obstacle.obstacle().name + ": expected fewer than 2^24 edges");
}

void ContactFinder::Impl::find_rest_neighbours(const Points& rest) {
  const double wanted_m = options_.thickness_m + options_.reach_m;
  gather_self(rest, 0.0);
  for (PairGroup& group : self_.groups) {
    const bool edges = group.kind == ContactKind::edge_edge;
    for (const NearPair& pair : group.pairs) {
      const double distance_m = pair.gap_m + options_.thickness_m;
      const double scale = distance_m > 1e-6 * wanted_m ? 0.9 * distance_m / wanted_m : 0.0;
      if (distance_m < wanted_m)
        rest_neighbours_.add(pair.a, pair.b, edges, static_cast<float>(scale));
    }
    group.pairs.clear();
  }
  rest_neighbours_.finish();
}

void ContactFinder::Impl::check(const Points& x) const {
  if (x.rows() != topology_.vertex_area_m2.size())
    throw InvalidInput("contact: " + std::to_string(x.rows()) + " positions for a cloth of " +
                       std::to_string(topology_.vertex_area_m2.size()) + " vertices");
}

// ---- what has moved since pairs were gathered

/// Motion that all of the cloth has in common does not count between its own parts.
void ContactFinder::Impl::measure(PairFamily& family, const Points& x) {
  const Eigen::RowVector3d shift =
      family.against_obstacles ? Eigen::RowVector3d(0, 0, 0)
                               : Eigen::RowVector3d((x - family.reference_m).colwise().mean());
  family.strayed_m.resize(x.rows());
  family.most_strayed_m = 0.0f;
  for (Eigen::Index v = 0; v < x.rows(); ++v) {
    family.strayed_m[v] = upwards((x.row(v) - family.reference_m.row(v) - shift).norm());
    family.most_strayed_m = std::max(family.most_strayed_m, family.strayed_m[v]);
  }
}

float ContactFinder::Impl::obstacle_strayed(int o, bool at_end) const {
  const double radius_m = placed_[o].radius_m(cloth_radius_m_);
  return upwards(at_end ? placed_[o].moved_at_end_m(radius_m) : placed_[o].moved_m(radius_m));
}

bool ContactFinder::Impl::is_stale(const PairFamily& family) const {
  if (!family.gathered) return true;
  float other = family.most_strayed_m;
  if (family.against_obstacles) {
    other = 0.0f;
    for (const float strayed : obstacle_strayed_) other = std::max(other, strayed);
  }
  return family.most_strayed_m + other > family.margin_m;
}

/// Wide enough that several updates share one gathering, no wider than pays.
void ContactFinder::Impl::adapt_margin(PairFamily& family) {
  if (!family.gathered) return;
  if (family.updates < 4) family.margin_m *= 1.5;
  if (family.updates > 16) family.margin_m /= 1.5;
  const double widest_m = std::max(options_.reach_m, 0.5 * mean_edge_m_);
  family.margin_m = std::clamp(family.margin_m, 0.5 * options_.reach_m, widest_m);
}

void ContactFinder::Impl::update(const Points& x) {
  check(x);
  if (!x.allFinite()) throw SolverError("contact: positions of the cloth are not finite");
  for (std::size_t o = 0; o < placed_.size(); ++o) {
    placed_[o].stay();
    if (against_.gathered) obstacle_strayed_[o] = obstacle_strayed(static_cast<int>(o), false);
  }
  for (PairFamily* family : {&self_, &against_}) {
    if (family->groups.empty()) continue;
    if (family->gathered) measure(*family, x);
    ++family->updates;
    if (is_stale(*family)) gather(*family, x);
  }
}

// ---- gathering

void ContactFinder::Impl::gather(PairFamily& family, const Points& x) {
  adapt_margin(family);
  family.updates = 0;
  family.gathered = true;
  family.reference_m = x;
  family.most_strayed_m = 0.0f;
  family.strayed_m.assign(x.rows(), 0.0f);
  ++statistics_.rebuilds;
  if (!family.against_obstacles) return gather_self(x, family.margin_m);
  cloth_radius_m_ = 0.0;
  fit_bounds(x, 0.0);
  for (std::size_t o = 0; o < placed_.size(); ++o) {
    placed_[o].set_reference();
    obstacle_strayed_[o] = 0.0f;
    const double farthest_m =
        (x.rowwise() - placed_[o].origin().transpose()).rowwise().norm().maxCoeff();
    cloth_radius_m_ = std::max(cloth_radius_m_, 2.0 * farthest_m);
    gather_against(static_cast<int>(o), x, family.margin_m);
  }
}

PairGroup& ContactFinder::Impl::group_of(std::vector<PairGroup>& groups, ContactKind kind,
                                         int obstacle) {
  return *std::find_if(groups.begin(), groups.end(), [&](const PairGroup& group) {
    return group.kind == kind && group.obstacle == obstacle;
  });
}

int ContactFinder::Impl::count_of_first(ContactKind kind) const {
  switch (kind) {
    case ContactKind::vertex_triangle:
    case ContactKind::vertex_solid:
    case ContactKind::vertex_mesh:
      return static_cast<int>(topology_.vertex_area_m2.size());
    case ContactKind::triangle_corner:
      return static_cast<int>(topology_.triangles.rows());
    default:
      return static_cast<int>(topology_.edges.size());
  }
}

/// What the tasks have found in that slot becomes the group's pairs.
void ContactFinder::Impl::collect(PairGroup& group, std::size_t task_count, int slot) {
  group.pairs.clear();
  for (std::size_t task = 0; task < task_count; ++task) {
    std::vector<NearPair>& found = found_[task][slot];
    group.pairs.insert(group.pairs.end(), found.begin(), found.end());
    found.clear();
  }
  sort_pairs(group.pairs, count_of_first(group.kind), scratch_, starts_);
}

void ContactFinder::Impl::fit_bounds(const Points& x, double inflation_m) {
  bounds_.vertices.resize(x.rows());
  for (Eigen::Index v = 0; v < x.rows(); ++v)
    bounds_.vertices[v] = box_around(x.row(v), inflation_m);
  bounds_.fit(topology_, tree_);
}

void ContactFinder::Impl::gather_self(const Points& x, double margin_m) {
  const double near_m = options_.reach_m + margin_m;
  const double reach_m = options_.thickness_m + near_m;
  fit_bounds(x, 0.5 * reach_m);
  const auto meet = [](const Box& a, const Box& b) { return a.meets(b); };
  const auto nodes_meet = [&](int n, int m) { return bounds_.nodes[n].meets(bounds_.nodes[m]); };
  const std::vector<BoundsTree::NodePair> tasks = tree_.self_tasks(nodes_meet);
  if (found_.size() < tasks.size()) found_.resize(tasks.size());
  PairGroup &vertices = self_.groups[0], &edges = self_.groups[1];
  parallel_for(tasks.size(), [&](std::size_t task) {
    const auto keep = [&](int a, int b, bool of_edges, double distance_m) {
      if (distance_m >= reach_m) return;
      const float scale = rest_neighbours_.scale(a, b, of_edges);
      const auto gap_m = static_cast<float>(distance_m - scale * options_.thickness_m);
      if (scale > 0.0f && gap_m < near_m) found_[task][of_edges].push_back({a, b, gap_m, scale});
    };
    const auto point = [&](int v) { return Vector3d(x.row(v)); };
    const auto vertex_triangle = [&](int v, int t) {
      const auto corners = topology_.triangles.row(t);
      const TrianglePoint closest =
          closest_on_triangle(point(v), point(corners[0]), point(corners[1]), point(corners[2]));
      keep(v, t, false, closest.offset_m.norm());
    };
    const auto edge_edge = [&](int e, int f) {
      const auto [a, b] = topology_.edges[e];
      const auto [c, d] = topology_.edges[f];
      keep(e, f, true, closest_on_segments(point(a), point(b), point(c), point(d)).offset_m.norm());
    };
    const auto leaf = [&](int i, int j) {
      if (bounds_.triangles[i].meets(bounds_.triangles[j]))
        for_parts_within(topology_, bounds_, i, j, meet, vertex_triangle, edge_edge);
    };
    tree_.self_pairs(tasks[task], nodes_meet, leaf);
  });
  collect(vertices, tasks.size(), 0);
  collect(edges, tasks.size(), 1);
}

void ContactFinder::Impl::gather_against(int obstacle, const Points& x, double margin_m) {
  if (!placed_[obstacle].is_solid()) return gather_mesh(obstacle, x, margin_m);
  gather_vertices(group_of(against_.groups, ContactKind::vertex_solid, obstacle), x, margin_m);
  gather_features(obstacle, x, margin_m);
}

void ContactFinder::Impl::gather_vertices(PairGroup& group, const Points& x, double margin_m) {
  const PlacedObstacle& obstacle = placed_[group.obstacle];
  const double near_m = options_.reach_m + margin_m;
  const std::size_t tasks = (x.rows() + chunk_size - 1) / chunk_size;
  if (found_.size() < tasks) found_.resize(tasks);
  parallel_for(tasks, [&](std::size_t task) {
    const auto begin = static_cast<int>(task) * chunk_size;
    const int end = std::min(begin + chunk_size, static_cast<int>(x.rows()));
    for (int v = begin; v < end; ++v) {
      const double gap_m = obstacle.closest(x.row(v)).distance_m - 0.5 * options_.thickness_m;
      if (gap_m < near_m) found_[task][0].push_back({v, 0, static_cast<float>(gap_m), 1.0f});
    }
  });
  collect(group, tasks, 0);
}

namespace {

/// Whether a segment meets a box that is inflated (the slabs of Kay and Kajiya 1986).
bool segment_meets(const Vector3d& from, const Vector3d& to, const Box& box, double inflation_m) {
  double enter = 0.0, leave = 1.0;
  for (int k = 0; k < 3; ++k) {
    const double along = to[k] - from[k];
    const double lower = box.lower[k] - inflation_m, upper = box.upper[k] + inflation_m;
    if (along == 0.0) {
      if (from[k] < lower || from[k] > upper) return false;
      continue;
    }
    const double a = (lower - from[k]) / along, b = (upper - from[k]) / along;
    enter = std::max(enter, std::min(a, b) - 1e-9);
    leave = std::min(leave, std::max(a, b) + 1e-9);
  }
  return enter <= leave;
}

}  // namespace

void ContactFinder::Impl::gather_features(int obstacle, const Points& x, double margin_m) {
  const PlacedObstacle& placed = placed_[obstacle];
  const auto& solid_edges = placed.edges();
  const std::size_t edge_count = solid_edges.size(), corner_count = placed.corners().rows();
  if (edge_count + corner_count == 0) return;
  const double near_m = options_.reach_m + margin_m;
  const double reach_m = 0.5 * options_.thickness_m + placed.rounding_m() + near_m;
  PairGroup& edges = group_of(against_.groups, ContactKind::edge_solid_edge, obstacle);
  PairGroup& corners = group_of(against_.groups, ContactKind::triangle_corner, obstacle);
  const std::size_t tasks = edge_count + corner_count;
  if (found_.size() < tasks) found_.resize(tasks);
  parallel_for(tasks, [&](std::size_t task) {
    const bool of_edge = task < edge_count;
    const auto feature = static_cast<int>(of_edge ? task : task - edge_count);
    const Vector3d from = placed.corners().row(of_edge ? solid_edges[feature][0] : feature);
    const Vector3d to = placed.corners().row(of_edge ? solid_edges[feature][1] : feature);
    const auto keep = [&](const PairGroup& group, int a) {
      NearPair pair{a, feature, 0.0f, 1.0f};
      Positions positions;
      load(group, pair, x, 0.0, nullptr, positions);
      pair.gap_m =
          static_cast<float>(closest_points(positions.points).offset_m.norm() - offset_m(group));
      if (pair.gap_m < near_m) found_[task][of_edge].push_back(pair);
    };
    tree_.query([&](int n) { return segment_meets(from, to, bounds_.nodes[n], reach_m); },
                [&](int t) {
                  if (!segment_meets(from, to, bounds_.triangles[t], reach_m)) return;
                  if (!of_edge) return keep(corners, t);
                  for (int k = 0; k < topology_.owned[t].edge_count; ++k)
                    keep(edges, topology_.owned[t].edges[k]);
                });
  });
  collect(edges, tasks, 1);
  collect(corners, tasks, 0);
}

void ContactFinder::Impl::gather_mesh(int obstacle, const Points& x, double margin_m) {
  const PlacedObstacle& placed = placed_[obstacle];
  const double near_m = options_.reach_m + margin_m;
  const double reach_m = 0.5 * options_.thickness_m + near_m;
  SurfaceBounds<Box>& others = mesh_bounds_[obstacle];
  others.vertices.resize(placed.corners().rows());
  for (Eigen::Index v = 0; v < placed.corners().rows(); ++v)
    others.vertices[v] = box_around(placed.corners().row(v), reach_m);
  others.fit(placed.topology(), placed.tree());
  std::array<PairGroup*, 3> groups = {
      &group_of(against_.groups, ContactKind::vertex_mesh, obstacle),
      &group_of(against_.groups, ContactKind::edge_mesh_edge, obstacle),
      &group_of(against_.groups, ContactKind::triangle_corner, obstacle)};
  const auto meet = [](const Box& a, const Box& b) { return a.meets(b); };
  const auto nodes_meet = [&](int n, int m) { return bounds_.nodes[n].meets(others.nodes[m]); };
  const std::vector<BoundsTree::NodePair> tasks =
      BoundsTree::cross_tasks(tree_, placed.tree(), nodes_meet);
  if (found_.size() < tasks.size()) found_.resize(tasks.size());
  parallel_for(tasks.size(), [&](std::size_t task) {
    const auto keep = [&](int slot, int a, int b) {
      NearPair pair{a, b, 0.0f, 1.0f};
      Positions positions;
      load(*groups[slot], pair, x, 0.0, nullptr, positions);
      pair.gap_m = static_cast<float>(closest_points(positions.points).offset_m.norm() -
                                      offset_m(*groups[slot]));
      if (pair.gap_m < near_m) found_[task][slot].push_back(pair);
    };
    const auto leaf = [&](int i, int j) {
      if (!bounds_.triangles[i].meets(others.triangles[j])) return;
      for_parts_between(
          topology_, bounds_, i, placed.topology(), others, j, meet,
          [&](int v, int t) { keep(0, v, t); }, [&](int e, int f) { keep(1, e, f); },
          [&](int t, int v) { keep(2, t, v); });
    };
    BoundsTree::cross_pairs(tree_, placed.tree(), tasks[task], nodes_meet, leaf);
  });
  for (int slot = 0; slot < 3; ++slot) collect(*groups[slot], tasks.size(), slot);
}

// ---- pairs

PairVertices ContactFinder::Impl::vertices_of(const PairGroup& group, const NearPair& pair) const {
  const auto vertex = [](int v) { return std::array<int, 3>{v, -1, -1}; };
  const auto edge = [&](int e) {
    return std::array<int, 3>{topology_.edges[e][0], topology_.edges[e][1], -1};
  };
  const auto triangle = [&](int t) {
    return std::array<int, 3>{topology_.triangles(t, 0), topology_.triangles(t, 1),
                              topology_.triangles(t, 2)};
  };
  switch (group.kind) {
    case ContactKind::vertex_triangle:
      return {1, 3, vertex(pair.a), triangle(pair.b)};
    case ContactKind::edge_edge:
      return {2, 2, edge(pair.a), edge(pair.b)};
    case ContactKind::triangle_corner:
      return {3, 0, triangle(pair.a), {}};
    case ContactKind::vertex_solid:
    case ContactKind::vertex_mesh:
      return {1, 0, vertex(pair.a), {}};
    default:
      return {2, 0, edge(pair.a), {}};
  }
}

/// Points of both pieces at a fraction of the step (of obstacles: of their way).
void ContactFinder::Impl::load(const PairGroup& group, const NearPair& pair, const Points& x,
                               double fraction, const Points* dx, Positions& result) const {
  result.vertices = vertices_of(group, pair);
  const PairVertices& vertices = result.vertices;
  PairPoints& points = result.points;
  const auto cloth = [&](int v) {
    Vector3d point = x.row(v);
    if (fraction > 0.0) point += fraction * dx->row(v).transpose();
    return point;
  };
  points.first_count = vertices.first_count;
  for (int i = 0; i < vertices.first_count; ++i) points.first[i] = cloth(vertices.first[i]);
  if (group.obstacle < 0) {
    points.second_count = vertices.second_count;
    for (int j = 0; j < vertices.second_count; ++j) points.second[j] = cloth(vertices.second[j]);
    return;
  }
  const PlacedObstacle& obstacle = placed_[group.obstacle];
  const auto set_corners = [&](std::initializer_list<int> corners) {
    points.second_count = 0;
    for (const int corner : corners)
      points.second[points.second_count++] = fraction > 0.0
                                                 ? obstacle.corner_at(corner, fraction)
                                                 : Vector3d(obstacle.corners().row(corner));
  };
  if (group.kind == ContactKind::triangle_corner) {
    set_corners({pair.b});
  } else if (group.kind == ContactKind::vertex_mesh) {
    const auto face = obstacle.faces().row(pair.b);
    set_corners({face[0], face[1], face[2]});
  } else {
    set_corners({obstacle.edges()[pair.b][0], obstacle.edges()[pair.b][1]});
  }
}

/// Whether the pair's gap stays at `gap_m` or more, from its gap when gathered and what has moved.
bool ContactFinder::Impl::is_far(const PairGroup& group, const NearPair& pair,
                                 const std::vector<float>& strayed, bool at_end,
                                 double gap_m) const {
  const PairVertices vertices = vertices_of(group, pair);
  float first = 0.0f, second = 0.0f;
  for (int i = 0; i < vertices.first_count; ++i)
    first = std::max(first, strayed[vertices.first[i]]);
  for (int j = 0; j < vertices.second_count; ++j)
    second = std::max(second, strayed[vertices.second[j]]);
  if (group.obstacle >= 0)
    second = at_end ? obstacle_path_[group.obstacle] : obstacle_strayed_[group.obstacle];
  return pair.gap_m - (first + second) > gap_m * (1.0 + 1e-6) + 1e-7 * std::abs(pair.gap_m);
}

void ContactFinder::Impl::list_chunks(const std::vector<PairGroup>& groups) {
  for (const PairGroup& group : groups)
    for (std::size_t begin = 0; begin < group.pairs.size(); begin += chunk_size)
      chunks_.push_back({&group, begin, std::min(begin + chunk_size, group.pairs.size())});
}

// ---- contacts

const std::vector<Contact>& ContactFinder::Impl::contacts(const Points& x) {
  check(x);
  chunks_.clear();
  list_chunks(self_.groups);
  list_chunks(against_.groups);
  if (chunk_contacts_.size() < chunks_.size()) chunk_contacts_.resize(chunks_.size());
  parallel_for(chunks_.size(), [&](std::size_t c) {
    const auto [group, begin, end] = chunks_[c];
    std::vector<Contact>& out = chunk_contacts_[c];
    out.clear();
    const std::vector<float>& strayed = is_self(group->kind) ? self_.strayed_m : against_.strayed_m;
    for (std::size_t i = begin; i < end; ++i) {
      const NearPair& pair = group->pairs[i];
      if (is_far(*group, pair, strayed, false, pair.scale * options_.reach_m)) continue;
      if (group->kind == ContactKind::vertex_solid) {
        add_solid_contact(*group, pair, x, out);
      } else {
        add_contact(*group, pair, x, out);
      }
    }
  });
  contacts_.clear();
  for (std::size_t c = 0; c < chunks_.size(); ++c)
    contacts_.insert(contacts_.end(), chunk_contacts_[c].begin(), chunk_contacts_[c].end());
  return contacts_;
}

void ContactFinder::Impl::add_solid_contact(const PairGroup& group, const NearPair& pair,
                                            const Points& x, std::vector<Contact>& out) const {
  const PlacedObstacle& obstacle = placed_[group.obstacle];
  const SurfacePoint surface = obstacle.closest(x.row(pair.a));
  const double gap_m = surface.distance_m - 0.5 * options_.thickness_m;
  if (!(gap_m < options_.reach_m)) return;
  Contact& contact = out.emplace_back();
  contact.vertex[0] = pair.a;
  contact.weight[0] = 1.0;
  contact.normal = surface.normal;
  contact.gap_m = gap_m;
  contact.reach_m = options_.reach_m;
  contact.area_m2 = topology_.vertex_area_m2[pair.a];
  contact.obstacle_point_m = surface.point_m;
  contact.obstacle_velocity_m_s = obstacle.velocity(surface.point_m);
  contact.obstacle = group.obstacle;
  contact.kind = group.kind;
  contact.key = key_of(group, pair);
}

double ContactFinder::Impl::pair_area(const PairGroup& group, const NearPair& pair,
                                      const PairPoints& points, double reach_m) const {
  switch (group.kind) {
    case ContactKind::vertex_triangle:
    case ContactKind::vertex_mesh:
      return 0.25 * topology_.vertex_area_m2[pair.a];
    case ContactKind::edge_edge:
      return 0.2 * parallel_factor(points) *
             std::sqrt(topology_.edge_area_m2[pair.a] * topology_.edge_area_m2[pair.b]);
    case ContactKind::edge_mesh_edge:
      return 0.2 * parallel_factor(points) *
             std::sqrt(topology_.edge_area_m2[pair.a] *
                       placed_[group.obstacle].topology().edge_area_m2[pair.b]);
    case ContactKind::edge_solid_edge:
      return 0.8 * parallel_factor(points) * reach_m * std::sqrt(topology_.edge_area_m2[pair.a]);
    default:
      return placed_[group.obstacle].is_solid()
                 ? reach_m * reach_m
                 : 0.25 * placed_[group.obstacle].topology().vertex_area_m2[pair.b];
  }
}

void ContactFinder::Impl::add_contact(const PairGroup& group, const NearPair& pair, const Points& x,
                                      std::vector<Contact>& out) const {
  Positions positions;
  load(group, pair, x, 0.0, nullptr, positions);
  const PairClosest closest = closest_points(positions.points);
  const double distance_m = closest.offset_m.norm();
  const double gap_m = distance_m - pair.scale * offset_m(group);
  const double reach_m = pair.scale * options_.reach_m;
  if (!(gap_m < reach_m)) return;
  const double area_m2 = pair_area(group, pair, positions.points, reach_m);
  if (!(area_m2 > 0.0)) return;  // parallel edges
  Contact& contact = out.emplace_back();
  int count = 0;
  const auto add = [&](int vertex, double weight) {
    contact.vertex[count] = vertex;
    contact.weight[count++] = weight;
  };
  const PairVertices& vertices = positions.vertices;
  for (int i = 0; i < vertices.first_count; ++i) add(vertices.first[i], closest.first[i]);
  for (int j = 0; j < vertices.second_count; ++j) add(vertices.second[j], -closest.second[j]);
  contact.normal = distance_m > 0.0 ? Vector3d(closest.offset_m / distance_m) : Vector3d::UnitY();
  contact.gap_m = gap_m;
  contact.reach_m = reach_m;
  contact.area_m2 = area_m2;
  contact.obstacle = group.obstacle;
  contact.kind = group.kind;
  contact.key = key_of(group, pair);
  if (group.obstacle < 0) return;
  const PlacedObstacle& obstacle = placed_[group.obstacle];
  const double rounding_m = obstacle.rounding_m();
  const PairPoints& points = positions.points;
  Vector3d& point = contact.obstacle_point_m;
  for (int j = 0; j < points.second_count; ++j) point += closest.second[j] * points.second[j];
  if (obstacle.is_solid()) {
    point += rounding_m * contact.normal;
    contact.obstacle_velocity_m_s = obstacle.velocity(point);
    return;
  }
  std::array<int, 3> corners{pair.b, -1, -1};
  if (group.kind == ContactKind::vertex_mesh) {
    for (int j = 0; j < 3; ++j) corners[j] = obstacle.faces()(pair.b, j);
  } else if (group.kind == ContactKind::edge_mesh_edge) {
    corners = {obstacle.edges()[pair.b][0], obstacle.edges()[pair.b][1], -1};
  }
  for (int j = 0; j < points.second_count; ++j)
    contact.obstacle_velocity_m_s += closest.second[j] * obstacle.corner_velocity(corners[j]);
}

// ---- steps

// Bound on steps. Two convex pieces whose closest points differ by the vector r have the planes
// with normal n = r / |r| between them. While each point of the first is at least h above each of
// the second, in the direction of n, their distance is at least h. For points in straight motion
// those heights are linear in time, so the time until which the least of them keeps `room` is known
// in closed form, and the pieces are safe until then. There the closest points are found anew, and
// so on: conservative advancement like that of Li, Kaufman and Jiang (2021), whose bound, the speed
// of the fastest points, is the special case of all motion along n. Sliding then costs nothing.
// Points of a body that turns leave their straight lines with a second derivative of angle squared
// times radius, which bounds their heights by parabolas.

PairMotion ContactFinder::Impl::motion_of(const PairGroup& group, const NearPair& pair,
                                          const PairVertices& vertices, const Points& dx) const {
  PairMotion motion;
  for (int i = 0; i < vertices.first_count; ++i) motion.first[i] = dx.row(vertices.first[i]);
  for (int j = 0; j < vertices.second_count; ++j) motion.second[j] = dx.row(vertices.second[j]);
  if (group.obstacle < 0) return motion;
  const PlacedObstacle& obstacle = placed_[group.obstacle];
  if (obstacle.is_solid()) {
    motion.second.fill(obstacle.shift());
    motion.bend_m = obstacle.turn_rad() * obstacle.turn_rad() * obstacle.radius_m(0.0);
  } else if (group.kind == ContactKind::vertex_mesh) {
    for (int j = 0; j < 3; ++j)
      motion.second[j] = obstacle.corner_shift(obstacle.faces()(pair.b, j));
  } else if (group.kind == ContactKind::edge_mesh_edge) {
    for (int j = 0; j < 2; ++j)
      motion.second[j] = obstacle.corner_shift(obstacle.edges()[pair.b][j]);
  } else {
    motion.second[0] = obstacle.corner_shift(pair.b);
  }
  return motion;
}

double ContactFinder::Impl::pair_step(const PairGroup& group, const NearPair& pair, const Points& x,
                                      const Points& dx, double limit) const {
  if (group.kind == ContactKind::vertex_solid) return solid_step(group, pair, x, dx, limit);
  const double offset = pair.scale * offset_m(group);
  Positions positions;
  load(group, pair, x, 0.0, nullptr, positions);
  PairMotion motion = motion_of(group, pair, positions.vertices, dx);
  double fraction = 0.0, room_m = 0.0, enough_m = 0.0;
  for (int search = 0; search < longest_search; ++search) {
    const PairClosest closest = closest_points(positions.points);
    const double distance_m = closest.offset_m.norm(), gap_m = distance_m - offset;
    if (search == 0) {
      if (!(gap_m > 0.0)) return 0.0;
      room_m = options_.kept_gap * gap_m;
      enough_m = 1.5 * room_m;
    } else if (gap_m < enough_m) {
      break;
    }
    if (motion.bend_m > 0.0)
      for (int j = 0; j < positions.points.second_count; ++j)
        motion.second[j] = placed_[group.obstacle].shift_of(positions.points.second[j], fraction);
    fraction +=
        plane_fraction(positions.points, motion, closest.offset_m / distance_m, offset + room_m);
    if (fraction >= limit) return limit;
    load(group, pair, x, fraction, &dx, positions);
  }
  return fraction;
}

double ContactFinder::Impl::solid_step(const PairGroup& group, const NearPair& pair,
                                       const Points& x, const Points& dx, double limit) const {
  const PlacedObstacle& obstacle = placed_[group.obstacle];
  const Vector3d from = x.row(pair.a), step = dx.row(pair.a);
  const double offset = 0.5 * options_.thickness_m, turn = obstacle.turn_rad();
  double fraction = 0.0, room_m = 0.0;
  for (int search = 0; search < longest_search; ++search) {
    const SurfacePoint surface = fraction > 0.0
                                     ? obstacle.closest_at(fraction, from + fraction * step)
                                     : obstacle.closest(from);
    const double gap_m = surface.distance_m - offset;
    if (search == 0) {
      if (!(gap_m > 0.0)) return 0.0;
      room_m = options_.kept_gap * gap_m;
    } else if (gap_m < 1.5 * room_m) {
      break;
    }
    // The plane that touches the solid moves with it. Its height below the vertex is n y with
    // y = vertex - touching point, whose second derivative is at most that of n (turn^2) times y,
    // twice that of n times y', and y'' = turn^2 times the touching point's distance from the
    // origin.
    const Vector3d relative = step - obstacle.shift_of(surface.point_m, fraction);
    const double radius_m =
        (surface.point_m - obstacle.origin() - fraction * obstacle.shift()).norm();
    const double speed_m = (step - obstacle.shift()).norm() + turn * radius_m;
    const double bend_m =
        turn * turn * (std::abs(surface.distance_m) + speed_m + radius_m) + 2.0 * turn * speed_m;
    fraction += first_time(gap_m - room_m, -surface.normal.dot(relative), bend_m);
    if (fraction >= limit) return limit;
  }
  return fraction;
}

/// How far each vertex strays from the reference until the end of the step.
void ContactFinder::Impl::measure_path(const PairFamily& family, const Points& x, const Points& dx,
                                       std::vector<float>& path) const {
  Eigen::RowVector3d shift = Eigen::RowVector3d::Zero();
  if (!family.against_obstacles)
    shift = (x - family.reference_m).colwise().mean() + dx.colwise().mean();
  path.resize(x.rows());
  for (Eigen::Index v = 0; v < x.rows(); ++v)
    path[v] = std::max(family.strayed_m[v],
                       upwards((x.row(v) + dx.row(v) - family.reference_m.row(v) - shift).norm()));
}

/// Whether a pair that was not gathered may come as near as a step must not.
bool ContactFinder::Impl::exceeds(const PairFamily& family, const std::vector<float>& path) const {
  if (family.groups.empty()) return false;
  const float most = *std::max_element(path.begin(), path.end());
  float other = most;
  if (family.against_obstacles)
    other = *std::max_element(obstacle_path_.begin(), obstacle_path_.end());
  return most + other > family.margin_m + (1.0 - options_.kept_gap) * options_.reach_m;
}

double ContactFinder::Impl::step(const Points& x, const Points& dx) {
  sweep(x, dx);
  chunks_.clear();
  list_chunks(self_.groups);
  list_chunks(against_.groups);
  const std::size_t gathered = chunks_.size();
  list_chunks(swept_);
  std::atomic<double> least = 1.0;  // only for speed: a pair's own limit does not depend on it
  parallel_for(chunks_.size(), [&](std::size_t c) {
    const auto [group, begin, end] = chunks_[c];
    const std::vector<float>& path = is_self(group->kind) ? self_path_ : against_path_;
    for (std::size_t i = begin; i < end; ++i) {
      const NearPair& pair = group->pairs[i];
      const double kept_m = options_.kept_gap * pair.scale * options_.reach_m;
      if (c < gathered && is_far(*group, pair, path, true, kept_m)) continue;
      const double limit = least.load(std::memory_order_relaxed);
      double fraction = pair_step(*group, pair, x, dx, limit), now = limit;
      while (fraction < now && !least.compare_exchange_weak(now, fraction)) {
      }
    }
  });
  return least;
}

double ContactFinder::Impl::max_step(const Points& x, const Points& dx) {
  check(x);
  check(dx);
  for (PlacedObstacle& obstacle : placed_) obstacle.stay();
  return step(x, dx);
}

double ContactFinder::Impl::max_step_until(const Points& x, const Points& dx, double time_s) {
  check(x);
  check(dx);
  for (PlacedObstacle& obstacle : placed_) obstacle.head_for(time_s);
  const double fraction = step(x, dx);
  for (PlacedObstacle& obstacle : placed_) obstacle.stay();
  return fraction;
}

void ContactFinder::Impl::move_obstacles(double time_s, double fraction) {
  for (PlacedObstacle& obstacle : placed_) {
    obstacle.head_for(time_s);
    obstacle.arrive(fraction);
  }
}

/// Between the pieces of a pair runs a plane that neither may cross: in the middle of the room that
/// there is, or nearer to the slower one. Each vertex may go as far as its side of it.
void ContactFinder::Impl::limit_vertices(const PairGroup& group, const NearPair& pair,
                                         const Points& x, const Points& dx,
                                         std::vector<std::pair<int, double>>& limits) const {
  if (group.kind == ContactKind::vertex_solid) {
    const SurfacePoint surface = placed_[group.obstacle].closest(x.row(pair.a));
    const double gap_m = surface.distance_m - 0.5 * options_.thickness_m;
    const double room_m = (1.0 - options_.kept_gap) * std::max(gap_m, 0.0);
    const double falling = -surface.normal.dot(dx.row(pair.a));
    if (falling > room_m) limits.emplace_back(pair.a, room_m / falling);
    return;
  }
  Positions positions;
  load(group, pair, x, 0.0, nullptr, positions);
  const PairClosest closest = closest_points(positions.points);
  const double distance_m = closest.offset_m.norm();
  const double gap_m = distance_m - pair.scale * offset_m(group);
  const Vector3d normal =
      distance_m > 0.0 ? Vector3d(closest.offset_m / distance_m) : Vector3d::UnitY();
  const double room_m = (1.0 - options_.kept_gap) * std::max(gap_m, 0.0);
  const PairVertices& vertices = positions.vertices;
  std::array<double, 3> falling{}, rising{};
  double most_falling = 0.0, most_rising = 0.0;
  for (int i = 0; i < vertices.first_count; ++i)
    most_falling = std::max(most_falling, falling[i] = -normal.dot(dx.row(vertices.first[i])));
  for (int j = 0; j < vertices.second_count; ++j)
    most_rising = std::max(most_rising, rising[j] = normal.dot(dx.row(vertices.second[j])));
  if (most_falling + most_rising <= room_m) return;
  const double share = most_falling / (most_falling + most_rising);
  double lowest = normal.dot(positions.points.first[0]);
  for (int i = 1; i < vertices.first_count; ++i)
    lowest = std::min(lowest, normal.dot(positions.points.first[i]));
  for (int i = 0; i < vertices.first_count; ++i) {
    const double allowed = normal.dot(positions.points.first[i]) - lowest + share * room_m;
    if (falling[i] > allowed) limits.emplace_back(vertices.first[i], allowed / falling[i]);
  }
  if (vertices.second_count == 0) return;
  double highest = normal.dot(positions.points.second[0]);
  for (int j = 1; j < vertices.second_count; ++j)
    highest = std::max(highest, normal.dot(positions.points.second[j]));
  for (int j = 0; j < vertices.second_count; ++j) {
    const double allowed =
        highest - normal.dot(positions.points.second[j]) + (1.0 - share) * room_m;
    if (rising[j] > allowed) limits.emplace_back(vertices.second[j], allowed / rising[j]);
  }
}

void ContactFinder::Impl::max_vertex_steps(const Points& x, const Points& dx,
                                           Eigen::VectorXd& fractions) {
  check(x);
  check(dx);
  for (PlacedObstacle& obstacle : placed_) obstacle.stay();
  sweep(x, dx);
  chunks_.clear();
  list_chunks(self_.groups);
  list_chunks(against_.groups);
  const std::size_t gathered = chunks_.size();
  list_chunks(swept_);
  if (chunk_limits_.size() < chunks_.size()) chunk_limits_.resize(chunks_.size());
  parallel_for(chunks_.size(), [&](std::size_t c) {
    const auto [group, begin, end] = chunks_[c];
    chunk_limits_[c].clear();
    const std::vector<float>& path = is_self(group->kind) ? self_path_ : against_path_;
    for (std::size_t i = begin; i < end; ++i) {
      const NearPair& pair = group->pairs[i];
      const double kept_m = options_.kept_gap * pair.scale * options_.reach_m;
      if (c < gathered && is_far(*group, pair, path, true, kept_m)) continue;
      limit_vertices(*group, pair, x, dx, chunk_limits_[c]);
    }
  });
  fractions.setOnes(x.rows());
  for (std::size_t c = 0; c < chunks_.size(); ++c)
    for (const auto& [vertex, fraction] : chunk_limits_[c])
      fractions[vertex] = std::min(fractions[vertex], fraction);
}

// ---- steps longer than the margin

/// Gathers pairs that are not near now but may meet during the step. Only parts that stray further
/// than the margin covers are looked at.
void ContactFinder::Impl::sweep(const Points& x, const Points& dx) {
  if (!dx.allFinite()) throw SolverError("contact: displacements of the cloth are not finite");
  for (PairGroup& group : swept_) group.pairs.clear();
  for (std::size_t o = 0; o < placed_.size(); ++o)
    obstacle_path_[o] = std::max(obstacle_strayed_[o], obstacle_strayed(static_cast<int>(o), true));
  const bool self = !self_.groups.empty(), against = !against_.groups.empty();
  if (self) measure_path(self_, x, dx, self_path_);
  if (against) measure_path(against_, x, dx, against_path_);
  const bool sweep_own = self && exceeds(self_, self_path_);
  const bool sweep_other = against && exceeds(against_, against_path_);
  if (!sweep_own && !sweep_other) return;
  ++statistics_.swept_searches;
  swept_bounds_.vertices.resize(x.rows());
  const auto fit = [&](const std::vector<float>& path) {
    for (Eigen::Index v = 0; v < x.rows(); ++v)
      swept_bounds_.vertices[v] = {box_around(x.row(v), 0.0), box_around(dx.row(v), 0.0), path[v]};
    swept_bounds_.fit(topology_, tree_);
  };
  if (sweep_own) {
    fit(self_path_);
    sweep_self();
  }
  if (!sweep_other) return;
  fit(against_path_);
  for (std::size_t o = 0; o < placed_.size(); ++o) {
    if (placed_[o].is_solid()) {
      sweep_solid(static_cast<int>(o), x, dx);
    } else {
      sweep_mesh(static_cast<int>(o));
    }
  }
}

void ContactFinder::Impl::sweep_self() {
  const double kept_m = options_.kept_gap * options_.reach_m;
  const auto room_m = static_cast<float>(options_.thickness_m + kept_m);
  const auto covered_m = static_cast<float>(self_.margin_m + options_.reach_m - kept_m);
  const auto meet = [&](const SweptBox& a, const SweptBox& b) {
    return a.strayed_m + b.strayed_m > covered_m && a.meets(b, room_m);
  };
  const auto nodes_meet = [&](int n, int m) {
    return meet(swept_bounds_.nodes[n], swept_bounds_.nodes[m]);
  };
  const std::vector<BoundsTree::NodePair> tasks = tree_.self_tasks(nodes_meet);
  if (found_.size() < tasks.size()) found_.resize(tasks.size());
  parallel_for(tasks.size(), [&](std::size_t task) {
    const auto keep = [&](int a, int b, bool edges) {
      const float scale = rest_neighbours_.scale(a, b, edges);
      if (scale > 0.0f) found_[task][edges].push_back({a, b, 0.0f, scale});
    };
    const auto leaf = [&](int i, int j) {
      if (!meet(swept_bounds_.triangles[i], swept_bounds_.triangles[j])) return;
      for_parts_within(
          topology_, swept_bounds_, i, j, meet, [&](int v, int t) { keep(v, t, false); },
          [&](int e, int f) { keep(e, f, true); });
    };
    tree_.self_pairs(tasks[task], nodes_meet, leaf);
  });
  collect(group_of(swept_, ContactKind::vertex_triangle, -1), tasks.size(), 0);
  collect(group_of(swept_, ContactKind::edge_edge, -1), tasks.size(), 1);
}

void ContactFinder::Impl::sweep_solid(int obstacle, const Points& x, const Points& dx) {
  const PlacedObstacle& placed = placed_[obstacle];
  const double kept_m = options_.kept_gap * options_.reach_m;
  const double covered_m = against_.margin_m + options_.reach_m - kept_m - obstacle_path_[obstacle];
  PairGroup& vertices = group_of(swept_, ContactKind::vertex_solid, obstacle);
  for (int v = 0; v < x.rows(); ++v) {
    if (against_path_[v] <= covered_m) continue;
    const Vector3d relative = dx.row(v) - placed.shift().transpose();
    const double radius_m =
        placed.radius_m((x.row(v).transpose() - placed.origin()).norm() + 2.0 * relative.norm());
    const double moved_m = relative.norm() + placed.turn_rad() * radius_m;
    const double gap_m = placed.closest(x.row(v)).distance_m - 0.5 * options_.thickness_m;
    if (gap_m < moved_m + kept_m) vertices.pairs.push_back({v, 0, 0.0f, 1.0f});
  }
  const std::size_t edge_count = placed.edges().size(), corner_count = placed.corners().rows();
  if (edge_count + corner_count == 0) return;
  PairGroup& edges = group_of(swept_, ContactKind::edge_solid_edge, obstacle);
  PairGroup& corners = group_of(swept_, ContactKind::triangle_corner, obstacle);
  // Points of a turning body leave their chords by at most radius times angle.
  const double excess_m = placed.turn_rad() * placed.radius_m(0.0);
  const auto room_m = static_cast<float>(0.5 * options_.thickness_m + placed.rounding_m() + kept_m);
  const auto corner_box = [&](int corner) {
    return SweptBox{box_around(placed.corners().row(corner), 0.0),
                    box_around(placed.shift(), excess_m), 0.0f};
  };
  const std::size_t tasks = edge_count + corner_count;
  if (found_.size() < tasks) found_.resize(tasks);
  parallel_for(tasks, [&](std::size_t task) {
    const bool of_edge = task < edge_count;
    const auto feature = static_cast<int>(of_edge ? task : task - edge_count);
    SweptBox box = corner_box(of_edge ? placed.edges()[feature][0] : feature);
    if (of_edge) box.include(corner_box(placed.edges()[feature][1]));
    const auto meets = [&](const SweptBox& part) {
      return part.strayed_m > covered_m && part.meets(box, room_m);
    };
    tree_.query([&](int n) { return meets(swept_bounds_.nodes[n]); },
                [&](int t) {
                  if (!meets(swept_bounds_.triangles[t])) return;
                  if (!of_edge) return found_[task][0].push_back({t, feature, 0.0f, 1.0f});
                  for (int k = 0; k < topology_.owned[t].edge_count; ++k)
                    if (const int e = topology_.owned[t].edges[k]; meets(swept_bounds_.edges[e]))
                      found_[task][1].push_back({e, feature, 0.0f, 1.0f});
                });
  });
  collect(edges, tasks, 1);
  collect(corners, tasks, 0);
}

void ContactFinder::Impl::sweep_mesh(int obstacle) {
  const PlacedObstacle& placed = placed_[obstacle];
  const double kept_m = options_.kept_gap * options_.reach_m;
  const auto room_m = static_cast<float>(0.5 * options_.thickness_m + kept_m);
  const auto covered_m = static_cast<float>(against_.margin_m + options_.reach_m - kept_m);
  SurfaceBounds<SweptBox>& others = swept_mesh_bounds_;
  others.vertices.resize(placed.corners().rows());
  for (int v = 0; v < placed.corners().rows(); ++v)
    others.vertices[v] = {box_around(placed.corners().row(v), 0.0),
                          box_around(placed.corner_shift(v), 0.0), obstacle_path_[obstacle]};
  others.fit(placed.topology(), placed.tree());
  const auto meet = [&](const SweptBox& a, const SweptBox& b) {
    return a.strayed_m + b.strayed_m > covered_m && a.meets(b, room_m);
  };
  const auto nodes_meet = [&](int n, int m) {
    return meet(swept_bounds_.nodes[n], others.nodes[m]);
  };
  const std::vector<BoundsTree::NodePair> tasks =
      BoundsTree::cross_tasks(tree_, placed.tree(), nodes_meet);
  if (found_.size() < tasks.size()) found_.resize(tasks.size());
  parallel_for(tasks.size(), [&](std::size_t task) {
    const auto keep = [&](int slot, int a, int b) {
      found_[task][slot].push_back({a, b, 0.0f, 1.0f});
    };
    const auto leaf = [&](int i, int j) {
      if (!meet(swept_bounds_.triangles[i], others.triangles[j])) return;
      for_parts_between(
          topology_, swept_bounds_, i, placed.topology(), others, j, meet,
          [&](int v, int t) { keep(0, v, t); }, [&](int e, int f) { keep(1, e, f); },
          [&](int t, int v) { keep(2, t, v); });
    };
    BoundsTree::cross_pairs(tree_, placed.tree(), tasks[task], nodes_meet, leaf);
  });
  collect(group_of(swept_, ContactKind::vertex_mesh, obstacle), tasks.size(), 0);
  collect(group_of(swept_, ContactKind::edge_mesh_edge, obstacle), tasks.size(), 1);
  collect(group_of(swept_, ContactKind::triangle_corner, obstacle), tasks.size(), 2);
}

// ---- the start, and figures

std::optional<std::string> ContactFinder::Impl::start_problem(const Points& x) {
  if (!x.allFinite()) return "a position of the cloth is not finite";
  const std::vector<Penetration> found = penetrations(x, false);
  if (!found.empty()) return describe(found.front(), placed_, found.size());
  update(x);
  for (const Contact& contact : contacts(x)) {
    if (contact.gap_m > 0.0) continue;
    const std::string other =
        contact.obstacle < 0 ? "another part of the cloth" : obstacles_[contact.obstacle].name;
    return "vertex " + std::to_string(contact.vertex[0]) + " of the cloth is nearer to " + other +
           " than the thickness by " + std::to_string(-1e3 * contact.gap_m) + " mm";
  }
  return std::nullopt;
}

ContactFinder::Statistics ContactFinder::Impl::statistics() const {
  Statistics result = statistics_;
  result.margin_m = std::max(self_.margin_m, against_.margin_m);
  for (const PairFamily* family : {&self_, &against_})
    for (const PairGroup& group : family->groups)
      result.candidates += static_cast<std::int64_t>(group.pairs.size());
  return result;
}

// ---- the interface

ContactFinder::ContactFinder(const ContactSurface& surface, std::vector<Obstacle> obstacles,
                             const ContactOptions& options)
    : impl_(std::make_unique<Impl>(surface, std::move(obstacles), options)) {}
ContactFinder::~ContactFinder() = default;
ContactFinder::ContactFinder(ContactFinder&&) noexcept = default;
ContactFinder& ContactFinder::operator=(ContactFinder&&) noexcept = default;

void ContactFinder::update(const Points& positions_m, double time_s) {
  impl_->place_obstacles(time_s);
  impl_->update(positions_m);
}
void ContactFinder::update(const Points& positions_m) { impl_->update(positions_m); }
const std::vector<Contact>& ContactFinder::contacts(const Points& positions_m) {
  return impl_->contacts(positions_m);
}
double ContactFinder::max_step(const Points& positions_m, const Points& displacement_m) {
  return impl_->max_step(positions_m, displacement_m);
}
void ContactFinder::max_vertex_steps(const Points& positions_m, const Points& displacement_m,
                                     Eigen::VectorXd& fractions) {
  impl_->max_vertex_steps(positions_m, displacement_m, fractions);
}
double ContactFinder::max_step_until(const Points& positions_m, const Points& displacement_m,
                                     double time_s) {
  return impl_->max_step_until(positions_m, displacement_m, time_s);
}
void ContactFinder::move_obstacles(double time_s, double fraction) {
  impl_->move_obstacles(time_s, fraction);
}
const std::vector<std::array<int, 2>>& ContactFinder::edges() const {
  return impl_->topology().edges;
}
const std::vector<Obstacle>& ContactFinder::obstacles() const { return impl_->obstacles(); }
const Points& ContactFinder::obstacle_positions(int obstacle) const {
  return impl_->placed(obstacle).corners();
}
std::vector<Penetration> ContactFinder::penetrations(const Points& positions_m,
                                                     bool brute_force) const {
  return impl_->penetrations(positions_m, brute_force);
}
std::optional<std::string> ContactFinder::start_problem(const Points& positions_m) {
  return impl_->start_problem(positions_m);
}
ContactFinder::Statistics ContactFinder::statistics() const { return impl_->statistics(); }

}  // namespace semblance
