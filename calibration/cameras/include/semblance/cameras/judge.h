// Whether to believe a calibration.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "semblance/cameras/adjustment.h"
#include "semblance/core/progress.h"

namespace semblance {

/// The further picture of the sheet that would make the projection most certain.
struct NextView {
  Rigid3 camera_from_sheet;
  Eigen::Matrix2Xd outline_px;  // the sheet's corners in the picture
  /// Deviation of the projection, root mean square over the picture.
  double mean_sigma_before_px = 0.0, mean_sigma_after_px = 0.0;
};

struct CameraVerdict {
  int placements = 0, sightings = 0, outliers = 0;
  double rms_px = 0.0;       // of the sightings that count
  double held_out_px = 0.0;  // the same by cameras that did not know the placement; 0 if untested
  int held_out = 0;          // sightings tested so
  Eigen::MatrixXi counts;    // sightings in each cell of the picture
  double coverage = 0.0;     // share of the cells with a sighting
  /// Deviation of the pixel of a direction, in each cell; empty where intrinsics were not sought.
  /// The rotation that undoes most of it is taken out.
  Eigen::MatrixXd sigma_px;
  std::optional<NextView> next;
};

/// How points seen by several cameras measure up to the target, each point placed by its rays
/// alone.
struct LengthCheck {
  int lengths = 0;           // pairs of neighbouring points
  double scale_error = 0.0;  // mean relative error of a length
  double rms_mm = 0.0;       // of a length
  double mean_length_m = 0.0;
};

struct Verdict {
  std::vector<CameraVerdict> cameras;
  std::optional<LengthCheck> lengths;  // where two cameras see a target of known points
  std::vector<std::string> warnings;   // why not to believe it, in words
};

/// Cells of the maps: rows and columns over the picture.
inline constexpr int verdict_rows = 9, verdict_columns = 16;

/// Judges by what a low residual does not say: the residual of placements that the cameras were not
/// fitted to (five parts; the placement of each is found from every other of its sightings, and the
/// rest are tested), where the picture is covered, how certain the projection is, and which picture
/// would help most.
Verdict judge(const Adjustment& adjustment, Progress& progress);

}  // namespace semblance
