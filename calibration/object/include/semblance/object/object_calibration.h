// A camera and an object's places before it, from pictures of a known mesh.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "semblance/core/camera.h"
#include "semblance/core/image.h"
#include "semblance/object/object_target.h"

namespace semblance {

/// A point of the object, and where a person or a detector saw it.
struct ObjectPair {
  std::string name;
  Eigen::Vector3d point_m;   // object's frame
  Eigen::Vector2d pixel_px;  // pixel centres at +0.5
};

/// One picture of the object. All pictures of a calibration are from one camera at one zoom.
struct ObjectPicture {
  std::string name;
  Image linear;  // RGB
  Image mask;    // empty, or of the picture's size: 1 where the object is seen, 3 channels
  std::vector<ObjectPair> pairs;
};

struct ObjectOptions {
  /// A known camera: its intrinsics are kept, its pose is ignored.
  std::optional<Camera> camera;
  Lens lens = Lens::pinhole;  // coefficients are sought; ignored where the camera is known
  bool principal = false;     // sought; otherwise the middle of the picture
  /// Deviation of a coordinate of a pair before its residuals say more.
  double pair_sigma_px = 4.0;
  bool refine = true;  // by comparison with the pictures; false keeps to the pairs
  std::function<bool()> cancelled;
};

/// Where the object is, and how well that is known.
struct ObjectPose {
  Rigid3 camera_from_object;
  /// Of a rotation about the camera's axes (rad) and of the place of the object's origin (m).
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
};

/// One state of the estimates.
struct ObjectEstimate {
  Camera camera;  // at the origin of its own frame: x right, y down, z forward
  /// Deviations of fx, fy, cx, cy and the coefficients; zero for what was kept.
  Eigen::VectorXd intrinsics_sigma;
  std::vector<ObjectPose> poses;  // of each picture
  double pairs_rms_px = 0.0;
  double pair_sigma_px = 0.0;  // what a coordinate of a pair turned out to be worth
  bool focal_free = false;     // otherwise its value is one that was given or assumed
};

/// How a picture agrees with the refined estimate.
struct ObjectFit {
  double outline_rms_px = 0.0;  // distance of the outline to the edges found for it
  double outline_share = 0.0;   // of the outline, for which an edge was found
  double colour_rms = 0.0;      // of the encoded intensities; 0 where colours are unknown
  double colour_correlation = 0.0;
  int outlier_pairs = 0;  // pairs farther off than four deviations
};

struct ObjectCalibration {
  ObjectEstimate from_pairs;
  std::optional<ObjectEstimate> refined;
  std::vector<ObjectFit> fits;     // of the refined estimate, per picture
  std::vector<std::string> notes;  // what could not be found out, in words
  int rounds = 0;
  double start_s = 0.0, solve_s = 0.0;  // the pairs' part, and the whole

  const ObjectEstimate& best() const { return refined ? *refined : from_pairs; }
};

/// Poses by POSIT and one adjustment over all pairs; then, from coarse to fine, one Gauss-Newton
/// solve over all pictures and the intrinsics that compares the outline of the drawn mesh with the
/// edges of the colours (or of the masks), its colours with the picture's under a light that is
/// estimated along, and the pairs with their pixels. The focal length is sought from pairs where a
/// picture has six of them, and by the comparison always, unless the camera is known.
///
/// The covariance is H^-1 C H^-1 with the Gauss-Newton Hessian H and the scatter C of the gradient
/// over cells of each picture (White, Econometrica 48, 1980; clusters as in Liang and Zeger,
/// Biometrika 73, 1986): neighbouring pixels err alike, and no model of that is needed.
///
/// Throws InvalidInput for pictures that differ in size, masks that do not fit, less than four
/// pairs in a picture, and pairs that give no pose; SolverError, naming the pictures, where the
/// object is not seen, its outline and colours are not found, or the comparison leads away from the
/// pairs.
ObjectCalibration calibrate_object(const ObjectTarget& target,
                                   const std::vector<ObjectPicture>& pictures,
                                   const ObjectOptions& options);

}  // namespace semblance
