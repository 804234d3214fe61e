#include "sheet_views.h"

#include <fmt/format.h>

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

void check_size(const Detection& detection, const std::string& name, const Camera& camera) {
  if (detection.width == camera.width && detection.height == camera.height) return;
  const bool turned = detection.width == camera.height && detection.height == camera.width;
  throw InvalidInput(fmt::format(
      "{} has {} x {} pixels, but camera '{}' is one of {} x {}: {}", name, detection.width,
      detection.height, camera.name, camera.width, camera.height,
      turned ? "the picture lies on its side. Turn the pictures alike, or calibrate the upright "
               "ones by themselves"
             : "a calibration holds for one size alone. Calibrate from pictures of this size, or "
               "leave out those of another"));
}

void check_not_mirrored(const Detection& detection, const std::string& name) {
  for (const DetectionWarning& warning : detection.warnings) {
    if (warning.kind == DetectionWarning::Kind::mirrored) {
      throw InvalidInput(name + ": " + warning.text);
    }
  }
}

}  // namespace semblance
