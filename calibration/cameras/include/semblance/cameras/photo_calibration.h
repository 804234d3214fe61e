// Photos without calibration: cameras and points from marks that several photos show.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "semblance/cameras/adjustment.h"

namespace semblance {

/// The marks that one photo shows: indices of points, and where they are (2 x n).
struct PhotoMarks {
  std::string name;
  int width = 0, height = 0;
  std::vector<int> points;
  Eigen::Matrix2Xd pixels_px;
};

struct PhotoOptions {
  /// Length by which the result is scaled; without one, the scale is that of the start.
  std::vector<KnownLength> lengths;
  Lens lens = Lens::pinhole;
  bool principal = false;  // sought; otherwise the middle of the picture
  int most_rounds = 2000;  // of the loop
  bool keep_outliers = false;
  std::function<bool()> cancelled;
};

struct PhotoCalibration {
  /// One camera at the origin of its own frame (x right, y down, z forward), a placement of the
  /// points per photo. Photos taken by one camera at one zoom share what they say of it.
  Survey survey;
  int rounds = 0;  // of the loop, or iterations of the joint adjustment
  double rms_px = 0.0;
  bool converged = false;
  double solve_s = 0.0;
  std::optional<Adjustment> adjustment;  // of the joint one: outliers, covariance
};

/// A survey to start from: photos posed by POSIT before points that are known roughly (a generic
/// model), with a guessed focal length. Throws InvalidInput naming the photo where that fails, for
/// less than two photos, and for photos that differ in size.
Survey start_from_photos(const std::vector<PhotoMarks>& photos,
                         const std::vector<Eigen::Vector3d>& rough_points_m, double focal_px,
                         const PhotoOptions& options);

/// The loop of the Mirages report, 5.2.1 and 5.3.3.3: cameras from the points, points from the
/// cameras, and so on until the error stays. Each half is a least-squares solve of `adjust`.
PhotoCalibration calibrate_by_loop(const Survey& start, const PhotoOptions& options);

/// All at once (bundle adjustment), with outliers and covariance.
PhotoCalibration calibrate_jointly(const Survey& start, const PhotoOptions& options);

}  // namespace semblance
