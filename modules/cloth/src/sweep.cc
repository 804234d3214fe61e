#include "contact_finder.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "semblance/core/errors.h"
#include "semblance/core/parallel.h"

namespace semblance {
namespace {

using Eigen::Vector3d;

}  // namespace

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
    for_chunks(swept_bounds_.vertices.size(), [&](std::size_t i) {
      const auto v = static_cast<Eigen::Index>(i);
      swept_bounds_.vertices[i] = {box_around(x.row(v), 0.0), box_around(dx.row(v), 0.0), path[i]};
    });
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

}  // namespace semblance
