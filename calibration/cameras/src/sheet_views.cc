#include "sheet_views.h"

#include "semblance/core/errors.h"

namespace semblance {

SheetView sheet_view(const Detection& detection) {
  SheetView view;
  view.pixels_px = detection.points_px;
  view.sheet_m.resize(2, view.pixels_px.cols());
  for (Eigen::Index i = 0; i < view.sheet_m.cols(); ++i) {
    view.sheet_m.col(i) =
        point_on_sheet(detection.target, detection.ids[static_cast<std::size_t>(i)]).head<2>();
  }
  return view;
}

void check_not_mirrored(const Detection& detection, const std::string& name) {
  for (const DetectionWarning& warning : detection.warnings) {
    if (warning.kind == DetectionWarning::Kind::mirrored) {
      throw InvalidInput(name + ": " + warning.text);
    }
  }
}

}  // namespace semblance
