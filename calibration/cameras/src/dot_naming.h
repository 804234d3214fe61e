// Which dots of a picture are which points of an object.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "semblance/core/camera.h"

namespace semblance {

/// A picture's dots with the points that they show.
struct Naming {
  Camera camera;  // as it was taken to be
  Rigid3 camera_from_object;
  std::vector<int> point_of_dot;  // -1: none
  int named = 0;
  double rms_px = 0.0;  // of the named ones
  /// Other names fit nearly as well: these are one of several possible sets.
  bool ambiguous = false;
};

/// Names dots by where they are. A pose is sought from three dots beside each other that are taken
/// for every three points beside each other, and counts by how many dots fall on points
/// (hypothesise and verify: Fischler and Bolles, "Random sample consensus", CACM 24, 1981, with
/// every sample of points instead of random ones).
class DotNamer {
 public:
  /// Normals out of the object, where known, hide points on its far side.
  DotNamer(std::vector<Eigen::Vector3d> points_m,
           std::vector<std::optional<Eigen::Vector3d>> normals);

  /// Without knowledge of the pose. `focal_known`: otherwise the focal length is sought near that
  /// of the camera. None where no pose explains most of the dots that it covers.
  std::optional<Naming> search(const Camera& camera, const Eigen::Matrix2Xd& dots_px,
                               bool focal_known) const;

  /// The best over a row of focal lengths around that of the camera.
  std::optional<Naming> search_focal(const Camera& camera, const Eigen::Matrix2Xd& dots_px,
                                     const std::vector<double>& factors) const;

  /// From a pose nearby; dots within `reach_px` of a point are taken for it.
  std::optional<Naming> near(const Camera& camera, const Rigid3& camera_from_object,
                             const Eigen::Matrix2Xd& dots_px, double reach_px) const;

  /// Dots by the nearest point within reach; where several points fall on one dot, the one in
  /// front.
  std::vector<int> assign(const Camera& camera, const Rigid3& camera_from_object,
                          const Eigen::Matrix2Xd& dots_px, double reach_px) const;

 private:
  class Search;
  struct Hypothesis;
  bool faces(int point, const Rigid3& camera_from_object) const;
  std::optional<Naming> refined(const Naming& start, const Eigen::Matrix2Xd& dots_px,
                                double reach_px, bool focal_known) const;

  std::vector<Eigen::Vector3d> points_m_;
  std::vector<std::optional<Eigen::Vector3d>> normals_;
  std::vector<std::vector<int>> neighbours_;  // of each point, the nearest first
};

/// A turn about some axis that leaves the points where other points were, in words ("turned by 90
/// degrees, point 0 falls on point 3, ..."); none where there is none. Then no picture tells which
/// point is which.
std::optional<std::string> symmetry_of(const std::vector<Eigen::Vector3d>& points_m,
                                       const std::vector<std::string>& names);

}  // namespace semblance
