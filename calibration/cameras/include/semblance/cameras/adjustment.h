// The one adjustment behind every calibration: least squares over reprojections, robust, with
// covariance.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "semblance/cameras/survey.h"

namespace semblance {

/// Which parameters of a camera are sought; the others are kept.
struct CameraFreedom {
  bool focal = true;   // one focal length, both axes scaled alike
  bool aspect = true;  // fy / fx
  bool principal = true;
  bool distortion = true;  // all coefficients of the lens
  bool pose = true;
  bool time_offset = false;

  static CameraFreedom none() { return {false, false, false, false, false, false}; }
  static CameraFreedom pose_only() { return {false, false, false, false, true, false}; }
};

/// A known distance between two points of the target.
struct KnownLength {
  int point_a = 0, point_b = 0;
  double length_m = 1.0, sigma_m = 1e-4;
};

/// A point whose place in the target's frame is known, with the deviation of each coordinate.
struct KnownPoint {
  int point = 0;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  double sigma_m = 1e-3;
};

struct AdjustmentOptions {
  std::vector<CameraFreedom> cameras;  // one per camera
  bool placements = true;
  std::optional<int> kept_placement;  // the one that is the frame, where no camera's pose is kept
  bool points = false;
  bool warp = false;
  std::vector<KnownLength> lengths;
  std::vector<KnownPoint> known_points;  // with `points`; three of them make a frame
  /// Sightings further off than this many deviations of the whole are outliers: named, left out.
  /// None keeps every sighting.
  std::optional<double> outlier_sigmas = 4.5;
  int max_iterations = 100;
  bool covariance = true;  // false saves its time
  /// Called between iterations; true stops the solve, which then has not converged.
  std::function<bool()> cancelled;
};

/// What is known about one camera after the adjustment. Rows and columns of parameters that were
/// kept are zero.
struct CameraUncertainty {
  Eigen::MatrixXd intrinsics;        // fx, fy, cx, cy, coefficients
  Eigen::Matrix<double, 6, 6> pose;  // rotation about the camera's axes (rad), translation (m)
  double time_offset_s = 0.0;        // deviation
};

/// Covariance of where the camera stands in the world, m^2.
Eigen::Matrix3d centre_covariance(const Camera& camera, const CameraUncertainty& uncertainty);

struct AdjustmentCovariance {
  std::vector<CameraUncertainty> cameras;
  std::vector<Eigen::Matrix<double, 6, 6>> placements;  // rotation about the world's axes, shift
  std::vector<Eigen::Matrix3d> points;                  // empty unless points were sought
  Eigen::Matrix3d warp = Eigen::Matrix3d::Zero();
};

struct Adjustment {
  AdjustmentOptions options;  // as asked for
  Survey survey;              // with the estimates
  std::vector<char> outlier;  // one per sighting
  double rms_px = 0.0;        // root mean squared distance of the sightings that count
  double rms_all_px = 0.0;    // of all sightings
  /// Deviation of one coordinate of an ordinary sighting (spread 1), from the residuals and the
  /// degrees of freedom.
  double sigma_px = 0.0;
  bool converged = false;
  int iterations = 0;
  double solve_s = 0.0;
  /// Absent where the sightings leave a parameter open; `undetermined` then names it.
  std::optional<AdjustmentCovariance> covariance;
  std::string undetermined;
};

/// Minimises the squared reprojection errors of `start`, each in its own deviation, over what
/// `options` leaves free.
///
/// The outliers are found in rounds: a solve with a Cauchy loss, whose scale is the median error,
/// tells which sightings stand out; then plain least squares over the rest, until the set of
/// outliers stays. The covariance is sigma^2 (J'J)^-1 of the last solve (Foerstner and Wrobel,
/// "Photogrammetric Computer Vision", eq. 4.68 and 4.72).
///
/// Throws InvalidInput for a survey that is not valid or less sightings than parameters, and
/// SolverError where a point starts behind its camera.
Adjustment adjust(const Survey& start, const AdjustmentOptions& options);

}  // namespace semblance
