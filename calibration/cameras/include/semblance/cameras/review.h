// Whether cameras that were calibrated before are still right, by new pictures of a sheet.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "semblance/cameras/rig_calibration.h"

namespace semblance {

/// One camera as given beside the same camera fitted anew.
struct CameraReview {
  double rms_px = 0.0;        // as given: only the sheet was placed
  double refit_rms_px = 0.0;  // with everything free
  /// How far the projections of the two differ over the picture, less a rotation of the camera; and
  /// the deviation of that, from the fit. Root mean square and greatest. Zero where it is not
  /// known.
  double mean_change_px = 0.0, worst_change_px = 0.0, mean_sigma_px = 0.0;
  /// How far the camera stands from where it was given, relative to the first one. Zero for that.
  double turn_rad = 0.0, shift_m = 0.0;
  double turn_sigma_rad = 0.0, shift_sigma_m = 0.0;
  bool has_sigma = false;
};

struct CalibrationReview {
  RigCalibration given;  // the cameras kept
  RigCalibration refit;  // alone_px: of a rig's cameras, everything free
  std::vector<CameraReview> cameras;
  std::vector<std::string> warnings;  // what has changed, in words
};

/// Fits the placements of the sheet to the cameras as they are given, then everything, and
/// compares. What differs by more than three deviations of the fit, and by more than 0.3 px, is
/// warned of.
///
/// Cameras of a rig that each fit their own views much better than the rig's were not looking at
/// one sheet at one time: that is said instead of blaming their places, which such pictures do not
/// tell, and lenses are then reviewed camera by camera.
///
/// `cameras`: those given, in the order of the views' indices. Throws as `calibrate_rig` does.
CalibrationReview review_calibration(const std::vector<RigView>& views,
                                     const std::vector<Camera>& cameras,
                                     const std::function<bool()>& cancelled = {});

}  // namespace semblance
