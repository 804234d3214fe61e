// A page that shows how tracking went.
#pragma once

#include <string>
#include <vector>

#include "semblance/io/track_file.h"
#include "semblance/pipeline/contact_sheet.h"

namespace semblance {

struct StageTime {
  std::string name;
  double seconds = 0.0;
};

/// A quantity of a pipeline's own with one value per frame of the track; NaN where there is none.
struct ReportCurve {
  std::string title, unit;
  std::vector<double> values;
  bool from_zero = false;  // the axis starts at zero
};

struct ReportInput {
  std::string title;                // what was tracked, for example the video's file name
  Track track;                      // as read_track gives it
  std::vector<StageTime> stages;    // may overlap in time
  double wall_s = 0.0;              // of the whole run
  ContactSheet pictures;            // possibly empty
  std::vector<ReportCurve> curves;  // shown before all others
};

/// Writes one self-contained HTML file: summary, curves of pose, expressions and fit with bands of
/// two standard deviations, lost spans, pictures, times and settings. A track without parameters
/// has only the curves that are given. It needs no other file and no network. Curves are thinned to
/// what can be seen, so the size hardly grows with the clip. Throws InvalidInput if the track's
/// header and frames do not fit together.
///
/// Angles are those of the head in the world frame, R = Ry(yaw) Rx(-pitch) Rz(roll): zero for a
/// face looking along the world's z, yaw towards its own left, pitch up, roll towards its right
/// shoulder. Their deviations are first order in those of the quaternion's entries, without
/// correlations.
void write_report(const std::string& path, const ReportInput& input);

/// Yaw, pitch and roll in radian of a unit quaternion (w, x, y, z), as defined for write_report.
Eigen::Vector3d head_angles(const Eigen::Vector4d& rotation_wxyz);
/// Their deviations, to first order, when the quaternion's entries vary independently.
Eigen::Vector3d head_angles_sigma(const Eigen::Vector4d& rotation_wxyz,
                                  const Eigen::Vector4d& sigma);

/// Indices, ascending, of at most two values in each of `buckets` equal parts of the sequence: the
/// least and the greatest, so that no extreme is lost. Non-finite values are left out.
std::vector<std::size_t> keep_extremes(const std::vector<double>& values, std::size_t buckets);

}  // namespace semblance
