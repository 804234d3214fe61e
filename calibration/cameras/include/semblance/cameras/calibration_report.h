// A page that shows a calibration and whether to believe it.
#pragma once

#include <string>
#include <vector>

#include "semblance/cameras/judge.h"

namespace semblance {

/// A picture with what was found in it drawn over it.
struct ReportPicture {
  std::string caption, svg;
};

struct CalibrationReport {
  std::string title, target;  // what was calibrated, and on what: a sheet as `target_text`, ...
  std::vector<std::string> sighting_names;  // per sighting of the survey: its picture
  double detect_s = 0.0;
  std::vector<std::string> notes;  // what the detection warned of
  std::vector<ReportPicture> pictures;
};

/// The picture of one camera's projection uncertainty as SVG: the deviation of each cell in
/// colours, the sightings with their residuals (40 times as long; outliers in red), and the next
/// view that would help most, dashed.
std::string uncertainty_svg(const Adjustment& adjustment, const Verdict& verdict, int camera);

/// Writes one self-contained HTML file: figures, warnings, each camera's parameters with deviations
/// and its map, and each picture's fit.
void write_calibration_report(const std::string& path, const Adjustment& adjustment,
                              const Verdict& verdict, const CalibrationReport& report);

}  // namespace semblance
