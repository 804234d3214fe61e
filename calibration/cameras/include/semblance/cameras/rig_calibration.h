// Several cameras from views of one sheet that is carried about before them.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "semblance/cameras/adjustment.h"
#include "semblance/cameras/detect.h"

namespace semblance {

/// The sheet in one camera's picture of one instant. The sheet stands still for an instant: views
/// of the same instant show it in one place.
struct RigView {
  int camera = 0;
  int instant = 0;
  std::string name;  // of the picture
  Detection detection;
  /// Speed of each point in the picture, for time offsets; NaN, or empty, where it is not known.
  Eigen::Matrix2Xd velocities_px_s{};
};

/// What is known of a camera beforehand. A pose that is kept needs `camera`.
struct RigCamera {
  std::string name;
  std::optional<Camera> camera{};  // intrinsics (and the pose, if kept) to start from or to keep
  bool keep_intrinsics = false;
  bool keep_pose = false;
};

struct RigOptions {
  Lens lens = Lens::brown5;   // of cameras that are not known
  bool aspect = true;         // otherwise their pixels are square
  bool principal = true;      // otherwise the middle of the picture
  bool warp = false;          // the sheet may be bent
  bool time_offsets = false;  // clocks but the first one's may be off
  double step_s = 0.0;        // from one instant to the next
  int most_lag = 0;           // instants that clocks may be off by, besides less than one
  bool keep_outliers = false;
  std::function<bool()> cancelled{};
};

struct RigCameraFit {
  int views = 0, points = 0, outliers = 0;
  double rms_px = 0.0;  // of the points that count
  /// The same by the camera's own views alone, each with a sheet of its own, where its lens was not
  /// given. A rig that fits much worse disagrees about times or places, not about lenses.
  std::optional<double> alone_px{};
};

struct RigCalibration {
  std::vector<Camera> cameras;
  std::vector<RigCameraFit> fits;
  Adjustment adjustment;      // placements are world_from_sheet of `instants`
  std::vector<int> instants;  // those that took part, ascending, by the first camera's numbers
  std::vector<double> time_offset_s;  // as Survey's, with the whole instants that a clock is off by
  std::vector<int> point_ids;
  std::vector<int> view_of_sighting;
};

/// The cameras that fit their own views well and the rig badly, with both figures, in words; empty
/// where there is none. Their pictures of one number may be of different times, or one has moved.
std::string disagreement(const RigCalibration& rig);

/// Unless a pose is kept, the first camera is the frame: it stands at the world's origin, upright
/// (Camera::centred). Cameras are chained from pair to pair along the views that they share, then
/// all is adjusted together.
///
/// Clocks: of the whole numbers of instants by which one of a pair may be late, the one with which
/// most sheets seen by both suit each other; the adjustment finds the rest from the speeds of the
/// points, as if these were constant for that long. Where offsets are sought, points of unknown
/// speed are left out, and clocks of cameras whose poses are kept are not off by whole instants.
///
/// Throws InvalidInput for cameras that no chain of common views links, naming them; for pictures
/// of one camera that differ in size; and for a camera whose intrinsics are neither known nor to be
/// had from its views.
RigCalibration calibrate_rig(const std::vector<RigView>& views,
                             const std::vector<RigCamera>& cameras, const RigOptions& options);

}  // namespace semblance
