#include "semblance/cloth/contact.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <span>

#include "contact_finder.h"
#include "penetration.h"
#include "semblance/core/errors.h"
#include "semblance/core/parallel.h"

namespace semblance {
namespace {

using Eigen::Vector3d;

constexpr double parallel_sin2 = 1e-3;  // edges below it fade out

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

const std::vector<Contact>& ContactFinder::Impl::contacts(const Points& x) {
  check(x);
  if (found_at_.rows() > 0 && found_at_ == x) return contacts_;
  found_at_ = x;
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
      return 4.0 * parallel_factor(points) * reach_m * std::sqrt(topology_.edge_area_m2[pair.a]);
    default:
      return placed_[group.obstacle].is_solid()
                 ? 25.0 * reach_m * reach_m
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

std::vector<Penetration> ContactFinder::Impl::penetrations(const Points& x,
                                                           bool brute_force) const {
  check(x);
  return find_penetrations(topology_, placed_, x, options_.self_contact, brute_force);
}

/// Vertices that cut a solid with their triangles or, if none do, are too near to one; with it.
std::set<std::pair<int, int>> ContactFinder::Impl::stuck_in_solids(const Points& x) {
  std::set<std::pair<int, int>> stuck;
  const auto add = [&](std::span<const int> vertices, int obstacle) {
    if (obstacle < 0 || !placed_[obstacle].is_solid()) return;
    for (const int v : vertices)
      if (v >= 0) stuck.emplace(v, obstacle);
  };
  for (const Penetration& found : penetrations(x, false)) {
    if (found.kind == Penetration::Kind::obstacle_edge_cloth_triangle) {
      add(found.triangle, found.obstacle);
    } else {
      add(found.edge, found.obstacle);
    }
  }
  if (!stuck.empty()) return stuck;
  update(x);
  for (const Contact& contact : contacts(x))
    if (contact.gap_m <= 0.0) add(contact.vertex, contact.obstacle);
  return stuck;
}

double ContactFinder::Impl::push_out(Points& x, double stride_m) {
  constexpr int most_rounds = 30;
  const Points start = x;
  for (int round = 0; round < most_rounds; ++round) {
    const auto stuck = stuck_in_solids(x);
    if (stuck.empty()) break;
    for (const auto& [v, obstacle] : stuck)
      x.row(v) += stride_m * placed_[obstacle].closest(x.row(v)).normal;
  }
  return (x - start).rowwise().norm().maxCoeff();
}

std::optional<std::string> ContactFinder::Impl::start_problem(const Points& x) {
  if (!x.allFinite()) return "a position of the cloth is not finite";
  const std::vector<Penetration> found = penetrations(x, false);
  if (!found.empty()) {
    // The first of those without depth, or the deepest.
    const auto worst = std::ranges::max_element(found, {}, &Penetration::depth_m);
    return describe(*worst, placed_, found.size());
  }
  update(x);
  for (const Contact& contact : contacts(x)) {
    if (contact.gap_m > 0.0) continue;
    const std::string other =
        contact.obstacle < 0 ? "another part of the cloth" : obstacles_[contact.obstacle].name;
    return "vertex " + std::to_string(contact.vertex[0] + 1) + " of the cloth is nearer to " +
           other + " than the thickness by " + std::to_string(-1e3 * contact.gap_m) + " mm";
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
double ContactFinder::push_out(Points& positions_m, double stride_m) {
  return impl_->push_out(positions_m, stride_m);
}
std::optional<std::string> ContactFinder::start_problem(const Points& positions_m) {
  return impl_->start_problem(positions_m);
}
ContactFinder::Statistics ContactFinder::statistics() const { return impl_->statistics(); }

}  // namespace semblance
