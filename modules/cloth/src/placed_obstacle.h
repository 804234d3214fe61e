// An obstacle as it stands now, and on its way to where it will be.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <memory>
#include <vector>

#include "bounds_tree.h"
#include "semblance/cloth/obstacle.h"
#include "surface_topology.h"

namespace semblance {

class PlacedObstacle {
 public:
  explicit PlacedObstacle(const Obstacle& obstacle);

  bool is_solid() const { return obstacle_.solid != nullptr; }
  const Obstacle& obstacle() const { return obstacle_; }
  double rounding_m() const { return is_solid() ? obstacle_.solid->rounding_m : 0.0; }

  /// Corners of the core or of the mesh, in the world.
  const Points& corners() const { return corners_; }
  const std::vector<std::array<int, 2>>& edges() const;
  /// Whether a side of a face (smaller corner first) is an edge, not a diagonal.
  bool has_edge(const std::array<int, 2>& side) const;
  const Triangles& faces() const;
  const SurfaceTopology& topology() const { return topology_; }  // of a mesh
  const BoundsTree& tree() const { return *tree_; }              // of a mesh

  /// Stands where it is at that time, and goes nowhere.
  void place(double time_s);
  /// Will go to where it is at that time; place() and arrive() end the way.
  void head_for(double time_s);
  /// That fraction of the way, and no further.
  void arrive(double fraction);
  void stay();

  /// Of a solid, signed, with the normal in the world.
  SurfacePoint closest(const Eigen::Vector3d& point_m) const {
    return closest_from(place_, point_m);
  }
  SurfacePoint closest_at(double fraction, const Eigen::Vector3d& point_m) const {
    return closest_from(place_at(fraction), point_m);
  }
  /// A corner at a fraction of the way.
  Eigen::Vector3d corner_at(int corner, double fraction) const;
  bool turns() const { return turn_rad_ > 0.0; }
  double turn_rad() const { return turn_rad_; }
  const Eigen::Vector3d& origin() const { return place_.translation_m; }
  /// Straight way of the origin; of a mesh's corner.
  const Eigen::Vector3d& shift() const { return shift_; }
  Eigen::Vector3d corner_shift(int corner) const;
  /// Displacement per way of a point of a solid that is at `point_m` at a fraction of the way.
  Eigen::Vector3d shift_of(const Eigen::Vector3d& point_m, double fraction) const {
    return shift_ + turn_.cross(point_m - place_.translation_m - fraction * shift_);
  }

  /// Marks the present place as the reference of moved_m.
  void set_reference() {
    reference_ = place_;
    corners_reference_ = corners_;
  }
  /// Bound on how far any point of the surface has moved since then, now and at the end of the way,
  /// up to `radius_m` from the origin for a plane.
  double moved_m(double radius_m) const;
  double moved_at_end_m(double radius_m) const;
  double radius_m(double of_plane) const { return unbounded_ ? of_plane : radius_; }

  Eigen::Vector3d velocity(const Eigen::Vector3d& point_m) const;  // of a solid
  Eigen::Vector3d corner_velocity(int corner) const { return corner_velocity_.row(corner); }

 private:
  Rigid3 place_at(double fraction) const;
  SurfacePoint closest_from(const Rigid3& place, const Eigen::Vector3d& point_m) const;
  void positions(double time_s, Rigid3& place, Points& corners) const;
  double moved(const Rigid3& place, const Points& corners, double radius_m) const;
  void find_velocity(double time_s);

  Obstacle obstacle_;
  SurfaceTopology topology_;
  std::unique_ptr<BoundsTree> tree_;
  bool unbounded_ = false;
  double radius_ = 0.0;  // about the origin
  Rigid3 place_, target_, reference_;
  Points corners_, corners_target_, corners_reference_, corner_velocity_;
  Eigen::Vector3d shift_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d turn_ = Eigen::Vector3d::Zero();  // rotation vector of the way
  double turn_rad_ = 0.0;
  Eigen::Vector3d velocity_ = Eigen::Vector3d::Zero(), spin_ = Eigen::Vector3d::Zero();
};

}  // namespace semblance
