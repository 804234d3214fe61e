// Photos without calibration: cameras and points from marks that several photos show.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "semblance/cameras/adjustment.h"
#include "semblance/io/colmap.h"
#include "semblance/io/marks_io.h"

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
  /// Three or more make the frame; without them it is that of the first photo.
  std::vector<KnownPoint> known_points;
  Lens lens = Lens::pinhole;
  bool principal = false;  // sought; otherwise the middle of the picture
  int most_rounds = 2000;  // of the loop
  bool keep_outliers = false;
  std::function<bool()> cancelled;
};

struct PhotoCalibration {
  /// One camera at the origin of its own frame (x right, y down, z forward), a placement of the
  /// points per photo. Photos taken by one camera at one zoom share what they say of it. Of
  /// calibrate_with_lenses: a camera per photo, and the points where they are.
  Survey survey;
  int rounds = 0;  // of the loop, or iterations of the joint adjustment
  double rms_px = 0.0;
  bool converged = false;
  double solve_s = 0.0;
  std::optional<Adjustment> adjustment;  // of the joint one: outliers, covariance
};

/// A survey to start from: photos posed by POSIT before points that are known roughly (a generic
/// model), with a guessed focal length. Points of which nothing is known (NaN) are placed by the
/// photos; those that no two photos show from different sides get no sightings. Throws InvalidInput
/// naming the photo where that fails, for less than two photos, and for photos that differ in size.
Survey start_from_photos(const std::vector<PhotoMarks>& photos,
                         const std::vector<Eigen::Vector3d>& rough_points_m, double focal_px,
                         const PhotoOptions& options);

/// A survey to start from where nothing is known of the points: the essential matrix of two photos
/// that share eight marks, for a row of focal lengths, then photo after photo. Its scale is
/// arbitrary, its frame that of a photo; with `options.known_points`, three of which must have a
/// place, it is theirs. Throws InvalidInput for less than three photos, photos that differ in size
/// and too few marks in common; SolverError where no start fits, naming photos that do not.
Survey start_from_marks_alone(const std::vector<PhotoMarks>& photos, std::size_t points,
                              const PhotoOptions& options);

/// The marks of each photo, by index into `marks.names()`. Opens the photos for their sizes.
std::vector<PhotoMarks> photos_with_marks(const MarksFile& marks);

/// `start_from_photos` with a row of focal lengths from 0.7 to 4 times the longer side of the
/// picture; the one from which the joint adjustment ends best. `start_from_marks_alone` where less
/// than six points are roughly known. Throws as those do, and SolverError where none leads to a
/// fit.
Survey best_start_from_photos(const std::vector<PhotoMarks>& photos,
                              const std::vector<Eigen::Vector3d>& rough_points_m,
                              const PhotoOptions& options);

/// Photos by cameras whose lenses are known, one camera per photo: their places and the points'
/// (bundle adjustment), with outliers and covariance. The start is as for start_from_photos, and
/// so are the errors. Without `known_points` the frame is that of the first camera.
PhotoCalibration calibrate_with_lenses(const std::vector<Camera>& cameras,
                                       const std::vector<PhotoMarks>& photos,
                                       const std::vector<Eigen::Vector3d>& rough_points_m,
                                       const PhotoOptions& options);

/// A model of COLMAP's whose images are of one camera, as a survey to adjust further: a placement
/// per image, in the order of their numbers. Throws InvalidInput for several cameras.
Survey survey_from_colmap(const ColmapModel& model);

/// A camera for each placement: the survey's one camera with its place in the frame of the points.
/// `names` are theirs.
std::vector<Camera> cameras_of_photos(const Survey& survey, const std::vector<std::string>& names);

/// The loop of the Mirages report, 5.2.1 and 5.3.3.3: cameras from the points, points from the
/// cameras, and so on until the error stays. Each half is a least-squares solve of `adjust`.
PhotoCalibration calibrate_by_loop(const Survey& start, const PhotoOptions& options);

/// All at once (bundle adjustment), with outliers and covariance.
PhotoCalibration calibrate_jointly(const Survey& start, const PhotoOptions& options);

}  // namespace semblance
