// Photos with what was found in them drawn over, for reports.
#pragma once

#include <string>
#include <vector>

#include "semblance/cameras/calibration_report.h"
#include "semblance/io/video.h"

namespace semblance::cli {

/// The start of an SVG that shows a photo; ends with "</svg>". Units are the photo's pixels.
std::string svg_over(const Rgb8& photo);

/// A name beside a place, with a dark rim so that it can be read on anything.
std::string svg_name(const Eigen::Vector2d& at_px, double font_px, const char* colour,
                     const std::string& name);

/// A mark of a photo, and where the solution sees its point.
struct DrawnMark {
  std::string name;
  Eigen::Vector2d mark_px, seen_px;
  bool outlier = false;
};

/// The photo with rings at marks, names, and lines towards where the points are seen, ten times as
/// long as the difference.
ReportPicture draw_marks(const std::string& file, const std::vector<DrawnMark>& marks);

}  // namespace semblance::cli
