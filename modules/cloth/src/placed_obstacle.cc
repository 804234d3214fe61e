#include "placed_obstacle.h"

#include <algorithm>
#include <string>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

using Eigen::Vector3d;

constexpr double velocity_interval_s = 1e-4;

void move_corners(const Rigid3& place, const Points& body, Points& world) {
  world.noalias() = body * place.rotation.toRotationMatrix().transpose();
  world.rowwise() += place.translation_m.transpose();
}

}  // namespace

PlacedObstacle::PlacedObstacle(const Obstacle& obstacle) : obstacle_(obstacle) {
  if (!obstacle.solid == !obstacle.surface)
    throw InvalidInput(obstacle.name + ": an obstacle is either a solid or a mesh");
  const Points& body = is_solid() ? obstacle.solid->corners_m : obstacle.surface->positions_m;
  unbounded_ = is_solid() && body.rows() == 0;
  radius_ = rounding_m() + (body.rows() > 0 ? body.rowwise().norm().maxCoeff() : 0.0);
  place(0.0);
  if (is_solid()) return;
  if (obstacle.surface->triangle_count() == 0)
    throw InvalidInput(obstacle.name + ": the mesh has no triangles");
  tree_ = std::make_unique<BoundsTree>(corners_, obstacle.surface->triangles);
  topology_ = make_topology(corners_, obstacle.surface->triangles, tree_->order());
  tree_->renumber();
}

const std::vector<std::array<int, 2>>& PlacedObstacle::edges() const {
  return is_solid() ? obstacle_.solid->edges : topology_.edges;
}

bool PlacedObstacle::has_edge(const std::array<int, 2>& edge) const {
  if (!is_solid()) return true;  // all sides of its triangles
  return std::binary_search(edges().begin(), edges().end(), edge);
}

const Triangles& PlacedObstacle::faces() const {
  return is_solid() ? obstacle_.solid->faces : topology_.triangles;
}

void PlacedObstacle::positions(double time_s, Rigid3& place, Points& corners) const {
  place = obstacle_.world_from_body ? obstacle_.world_from_body(time_s) : Rigid3{};
  const Points& body = is_solid() ? obstacle_.solid->corners_m : obstacle_.surface->positions_m;
  if (!is_solid() && obstacle_.vertices) {
    corners.resize(body.rows(), 3);
    obstacle_.vertices(time_s, corners);
    if (corners.rows() != body.rows() || !corners.allFinite())
      throw InvalidInput(obstacle_.name + ": at " + std::to_string(time_s) +
                         " s its motion gives positions that are not finite or of another number");
    return;
  }
  if (!place.rotation.coeffs().allFinite() || !place.translation_m.allFinite())
    throw InvalidInput(obstacle_.name + ": its place at " + std::to_string(time_s) +
                       " s is not finite");
  move_corners(place, body, corners);
}

void PlacedObstacle::place(double time_s) {
  positions(time_s, place_, corners_);
  find_velocity(time_s);
  stay();
}

void PlacedObstacle::stay() {
  target_ = place_;
  corners_target_ = corners_;
  shift_.setZero();
  turn_.setZero();
  turn_rad_ = 0.0;
}

void PlacedObstacle::head_for(double time_s) {
  positions(time_s, target_, corners_target_);
  find_velocity(time_s);
  if (!is_solid()) return;  // its corners go straight
  shift_ = target_.translation_m - place_.translation_m;
  turn_ = rotation_vector_from_quaternion(target_.rotation * place_.rotation.conjugate());
  turn_rad_ = turn_.norm();
  if (turn_rad_ < 1e-12) {
    turn_.setZero();
    turn_rad_ = 0.0;
    target_.rotation = place_.rotation;
  }
}

void PlacedObstacle::arrive(double fraction) {
  if (is_solid()) {
    place_ = place_at(fraction);
    move_corners(place_, obstacle_.solid->corners_m, corners_);
  } else {
    corners_ += fraction * (corners_target_ - corners_);
  }
  stay();
}

Rigid3 PlacedObstacle::place_at(double fraction) const {
  return {turns() ? place_.rotation.slerp(fraction, target_.rotation) : place_.rotation,
          place_.translation_m + fraction * shift_};
}

SurfacePoint PlacedObstacle::closest_from(const Rigid3& place, const Vector3d& point_m) const {
  const Eigen::Matrix3d rotation = place.rotation.toRotationMatrix();
  SurfacePoint result =
      obstacle_.solid->closest(rotation.transpose() * (point_m - place.translation_m));
  result.normal = rotation * result.normal;
  result.point_m = rotation * result.point_m + place.translation_m;
  return result;
}

Vector3d PlacedObstacle::corner_at(int corner, double fraction) const {
  if (turns()) return place_at(fraction) * Vector3d(obstacle_.solid->corners_m.row(corner));
  return Vector3d(corners_.row(corner)) + fraction * corner_shift(corner);
}

Vector3d PlacedObstacle::corner_shift(int corner) const {
  if (is_solid()) return shift_;
  return corners_target_.row(corner) - corners_.row(corner);
}

double PlacedObstacle::moved(const Rigid3& place, const Points& corners, double radius_m) const {
  if (!is_solid()) return (corners - corners_reference_).rowwise().norm().maxCoeff();
  return (place.translation_m - reference_.translation_m).norm() +
         place.rotation.angularDistance(reference_.rotation) * radius_m;
}

double PlacedObstacle::moved_m(double radius_m) const { return moved(place_, corners_, radius_m); }

double PlacedObstacle::moved_at_end_m(double radius_m) const {
  return moved(target_, corners_target_, radius_m);
}

void PlacedObstacle::find_velocity(double time_s) {
  Rigid3 before, after;
  Points corners_before, corners_after;
  positions(time_s - 0.5 * velocity_interval_s, before, corners_before);
  positions(time_s + 0.5 * velocity_interval_s, after, corners_after);
  corner_velocity_ = (corners_after - corners_before) / velocity_interval_s;
  velocity_ = (after.translation_m - before.translation_m) / velocity_interval_s;
  spin_ = rotation_vector_from_quaternion(after.rotation * before.rotation.conjugate()) /
          velocity_interval_s;
}

Vector3d PlacedObstacle::velocity(const Vector3d& point_m) const {
  return velocity_ + spin_.cross(point_m - place_.translation_m);
}

}  // namespace semblance
