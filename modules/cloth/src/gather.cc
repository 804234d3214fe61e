#include "contact_finder.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "semblance/cloth/distance.h"
#include "semblance/core/errors.h"
#include "semblance/core/parallel.h"

namespace semblance {
namespace {

using Eigen::Vector3d;

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
  // From 0.6 of an edge on, every part of a flat square grid is near its neighbours.
  const double widest_m =
      std::max(options_.reach_m, 0.55 * mean_edge_m_ - options_.reach_m - options_.thickness_m);
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
  for_chunks(bounds_.vertices.size(), [&](std::size_t v) {
    bounds_.vertices[v] = box_around(x.row(static_cast<Eigen::Index>(v)), inflation_m);
  });
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

}  // namespace semblance
