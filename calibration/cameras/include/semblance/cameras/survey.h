// What a calibration knows and seeks: cameras, placements of a target, its points, and sightings.
#pragma once

#include <string>
#include <vector>

#include "semblance/core/camera.h"

namespace semblance {

/// One point of the target in one camera's picture.
struct Sighting {
  int camera = 0, placement = 0, point = 0;  // indices into the survey
  Eigen::Vector2d pixel_px = Eigen::Vector2d::Zero();
  /// Speed of the point in the picture; needed only where time offsets are sought.
  Eigen::Vector2d velocity_px_s = Eigen::Vector2d::Zero();
  double spread = 1.0;  // its deviation, in those of an ordinary sighting
};

/// Every task of calibration is one of these: a sheet before one camera (camera fixed, a placement
/// per picture), a rig (a placement per instant, seen by several cameras), photos of marks (one
/// placement, fixed; points free).
struct Survey {
  std::vector<Camera> cameras;
  std::vector<Rigid3> world_from_target;  // the placements
  std::vector<Eigen::Vector3d> points_m;  // in the target's frame
  std::vector<Sighting> sightings;

  /// Bend of a target whose points lie about z = 0: over the box of the points scaled to
  /// u, v in [-1, 1], z += w0 (1 - u^2) + w1 (1 - v^2) + w2 u v. Metres.
  Eigen::Vector3d warp_m = Eigen::Vector3d::Zero();
  /// Per camera: a picture taken by its own clock at t shows the target as it was at
  /// t + time_offset_s.
  std::vector<double> time_offset_s;
};

/// A point of the target in its own frame, bent by the warp.
Eigen::Vector3d warped_point(const Survey& survey, int point);

/// Where the survey's estimates put a sighting, minus where it was seen. NaN behind the camera.
Eigen::Vector2d residual_px(const Survey& survey, const Sighting& sighting);

/// Throws InvalidInput naming `source` for indices out of range and figures that are not finite.
void validate(const Survey& survey, const std::string& source);

}  // namespace semblance
