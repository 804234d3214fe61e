#include "contact_finder.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <cmath>

#include "semblance/core/errors.h"
#include "semblance/core/parallel.h"

namespace semblance {
namespace {

using Eigen::Vector3d;

constexpr int longest_search = 100;  // advances until a step is taken as found

}  // namespace

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
  found_at_.resize(0, 3);
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

}  // namespace semblance
