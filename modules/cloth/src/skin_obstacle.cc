// Bodies from skinned meshes.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "semblance/cloth/obstacle.h"
#include "semblance/core/errors.h"

namespace semblance {
namespace {

/// At a steady rate from 0 on, and at the end.
std::vector<double> sample_times(double end_s, double frames_per_second) {
  std::vector<double> times_s{0.0};
  const double last = end_s * frames_per_second - 1e-6;
  for (int k = 1; k <= last; ++k) times_s.push_back(k / frames_per_second);
  if (end_s > 0.0) times_s.push_back(end_s);
  return times_s;
}

Points placed(Points points, const Eigen::Affine3d& world_from_skin, const std::string& name) {
  points = (points * world_from_skin.linear().transpose()).eval();
  points.rowwise() += world_from_skin.translation().transpose();
  if (!points.allFinite()) throw InvalidInput(name + ": its motion is not finite");
  return points;
}

}  // namespace

Obstacle make_skin_obstacle(const std::string& name, const SkinnedMesh& skin,
                            const SkinAnimation* animation, double frames_per_second,
                            const Eigen::Affine3d& world_from_skin) {
  const SkinnedMesh closed = without_seams(skin);
  const double end_s = animation == nullptr ? 0.0 : animation->end_s();
  constexpr double most_rows = 1e8;
  if (!((end_s * frames_per_second + 2.0) * closed.mesh.vertex_count() <= most_rows)) {
    throw InvalidInput(fmt::format(
        "{}: {:.4g} s of an animation of {} vertices at {:.4g} frames/s are more than 100 million "
        "positions; choose a lower rate or a coarser mesh",
        name, end_s, closed.mesh.vertex_count(), frames_per_second));
  }
  std::vector<double> times_s = sample_times(end_s, frames_per_second);
  std::vector<Points> frames_m;
  for (const double time_s : times_s) {
    const SkinPose pose = animation == nullptr ? rest_pose(closed.nodes)
                                               : animated_pose(closed.nodes, *animation, time_s);
    frames_m.push_back(placed(skinned_positions(closed, pose), world_from_skin, name));
  }
  Mesh mesh = closed.mesh;
  mesh.positions_m = frames_m[0];
  Obstacle obstacle = make_mesh_obstacle(name, std::move(mesh));
  const bool moves = std::any_of(frames_m.begin(), frames_m.end(),
                                 [&](const Points& frame) { return frame != frames_m[0]; });
  if (moves) obstacle.vertices = vertex_frames(std::move(times_s), std::move(frames_m));
  return obstacle;
}

}  // namespace semblance
