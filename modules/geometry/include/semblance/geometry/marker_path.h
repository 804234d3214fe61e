// The motion of one marker between two key frames, by homotopy.
//
// Source: Moubaraki, Tanaka and Kitamura, "Evaluation of the Homotopy Sweep Technique", ATR
// TR-C-0089 (1993), section 4.3 and appendix I. The printed program was not followed where it
// contradicts the section's own conditions: it takes |OB| for OB . u_r and so misses the second key
// frame, runs over t = k / count instead of k / (count - 1), leaves the offset of w undefined, and
// turns the sign of the second scaling function's height.
#pragma once

#include <Eigen/Core>

#include "semblance/geometry/homotopy.h"

namespace semblance {

/// How one component gets from its first value to its second: the blend's n > -1, and where its
/// scaling functions pass, as in appendix I: S1 through (alpha, beta * top of the parabola with the
/// same slope), S2 through (gamma, delta * that top), 0 < alpha, gamma < 1. The defaults are the
/// parabolas themselves. The tops are at a half, a quarter of the end slope high.
struct PathControls {
  double n = 0.0;
  double alpha = 0.5, beta = 1.0;
  double gamma = 0.5, delta = 1.0;
};

/// The report's parameters n (radial), m (tangential) and p (depth), and the scaling controls.
struct MarkerControls {
  PathControls radial, tangential;
  double depth_blend = 0.0;  // p
};

/// Throws InvalidInput, naming the parameter and its range.
void validate(const MarkerControls& controls);

/// A marker in a key frame, in any unit of length; `depth` may be zero throughout.
struct MarkerKey {
  double time_s = 0.0;
  Eigen::Vector2d position = Eigen::Vector2d::Zero();
  Eigen::Vector2d velocity = Eigen::Vector2d::Zero();  // per second
  double depth = 0.0;
};

struct PathPoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  // per second
};

/// M(t) = O + r(t) u_r + w(t) u_theta in the frame of the first key's direction from the reference
/// point O: r runs from |OA| to OB . u_r, w from 0 to OB . u_theta, both as HomotopyPath, and the
/// depth is z = (1 - R_p) z1 + R_p z2. Both keys and their velocities are met; the depth starts and
/// ends at rest. The homotopies run over v = (t - t1) / (t2 - t1), so their end slopes are the
/// velocities times (t2 - t1).
class MarkerPath {
 public:
  /// Throws InvalidInput: keys not in order of time, figures that are not finite, controls out of
  /// range, or a first key at the reference point, from where it has no direction.
  MarkerPath(const MarkerKey& first, const MarkerKey& second, const Eigen::Vector2d& reference,
             const MarkerControls& controls = {});

  /// Before the first key and after the second the marker is as at that key.
  PathPoint at(double time_s) const;

 private:
  double start_s_ = 0.0, duration_s_ = 1.0;
  Eigen::Vector2d reference_, radial_axis_, tangential_axis_;
  HomotopyPath radial_, tangential_;
  double first_depth_ = 0.0, depth_change_ = 0.0, depth_blend_ = 0.0;
};

}  // namespace semblance
