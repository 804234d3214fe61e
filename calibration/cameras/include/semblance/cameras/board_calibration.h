// One camera from pictures of a sheet.
#pragma once

#include <string>
#include <vector>

#include "semblance/cameras/adjustment.h"
#include "semblance/cameras/detect.h"

namespace semblance {

struct BoardOptions {
  Lens lens = Lens::brown5;
  bool aspect = true;     // otherwise pixels are square
  bool principal = true;  // otherwise the middle of the picture
  bool warp = false;      // the sheet may be bent
  bool keep_outliers = false;
  std::function<bool()> cancelled;
};

/// How one picture fits.
struct BoardView {
  std::string name;  // of the picture
  int points = 0;
  int outliers = 0;
  double rms_px = 0.0;  // of all of its points
  /// None where the view did not take part: too few points, or most of them outliers.
  std::optional<Rigid3> camera_from_sheet;
};

struct BoardCalibration {
  Camera camera;          // at the origin of its own frame: x right, y down, z forward
  Adjustment adjustment;  // placements are those of the views that took part, in their order
  std::vector<BoardView> views;
  std::vector<int> view_of_placement;
  std::vector<int> point_ids;  // of the survey's points
};

/// Calibrates from at least two pictures (three with a free principal point) of one camera. `names`
/// are those of the pictures.
///
/// The start is Zhang's closed form; where that finds no focal length, or the adjustment from it
/// ends badly, a row of focal lengths is tried, and the best end counts.
///
/// Throws InvalidInput for pictures of several sizes, mirrored sheets and too few views, and
/// SolverError where no start leads to a fit.
BoardCalibration calibrate_board(const std::vector<Detection>& detections,
                                 const std::vector<std::string>& names,
                                 const BoardOptions& options);

}  // namespace semblance
