#include "semblance/cameras/board_calibration.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include "semblance/core/errors.h"
#include "semblance/io/picture_size.h"
#include "sheet_circles.h"
#include "sheet_start.h"
#include "sheet_views.h"

namespace semblance {
namespace {

// A fit worse than this share of the picture's width is no fit.
constexpr double kBadFit = 0.004;

// The pictures that show enough of the sheet, and what they show.
struct UsefulViews {
  std::vector<int> index;  // among the pictures
  std::vector<SheetView> views;
};

UsefulViews useful_views(const std::vector<Detection>& detections, int fewest) {
  UsefulViews result;
  for (std::size_t i = 0; i < detections.size(); ++i) {
    if (static_cast<int>(detections[i].ids.size()) < kFewestPoints) continue;
    result.index.push_back(static_cast<int>(i));
    result.views.push_back(sheet_view(detections[i]));
  }
  if (static_cast<int>(result.index.size()) >= fewest) return result;
  throw InvalidInput(
      fmt::format("the sheet is seen in {} of {} pictures; {} are needed, tilted against each "
                  "other. Take more, "
                  "or name the sheet that they show with --target",
                  result.index.size(), detections.size(), fewest));
}

// A survey of the views that a camera could see; `taken` are their indices among the views.
struct Start {
  Survey survey;
  std::vector<int> taken;
  std::vector<double> radius_px;  // of each sighting's circle, if the sheet has circles
};

Start start_at(const Camera& camera, const std::vector<Detection>& detections,
               const UsefulViews& useful, const std::vector<int>& ids) {
  Start start;
  start.survey.cameras = {camera};
  std::map<int, int> point_of_id;
  for (const int id : ids) {
    point_of_id[id] = static_cast<int>(start.survey.points_m.size());
    const auto& target = detections[static_cast<std::size_t>(useful.index[0])].target;
    start.survey.points_m.push_back(point_on_sheet(target, id));
  }
  for (std::size_t i = 0; i < useful.views.size(); ++i) {
    const std::optional<Rigid3> pose = sheet_pose(camera, useful.views[i]);
    if (!pose) continue;
    const Detection& detection = detections[static_cast<std::size_t>(useful.index[i])];
    const int placement = static_cast<int>(start.survey.world_from_target.size());
    start.survey.world_from_target.push_back(*pose);
    start.taken.push_back(useful.index[i]);
    for (std::size_t k = 0; k < detection.ids.size(); ++k) {
      start.survey.sightings.push_back({0, placement, point_of_id[detection.ids[k]],
                                        detection.points_px.col(static_cast<Eigen::Index>(k))});
    }
    start.radius_px.insert(start.radius_px.end(), detection.radii_px.begin(),
                           detection.radii_px.end());
  }
  return start;
}

AdjustmentOptions adjustment_options(const BoardOptions& options) {
  AdjustmentOptions result;
  result.cameras = {
      CameraFreedom{.aspect = options.aspect, .principal = options.principal, .pose = false}};
  result.warp = options.warp;
  if (options.keep_outliers) result.outlier_sigmas.reset();
  result.cancelled = options.cancelled;
  return result;
}

struct Fit {
  Start start;
  Adjustment adjustment;
  double rms_px = std::numeric_limits<double>::infinity();  // typical, of all sightings

  bool good(const Camera& camera) const { return rms_px < kBadFit * camera.width; }
};

// The median of the lengths of the residuals: a few bad views do not spoil a start.
double typical_error_px(const Survey& survey) {
  std::vector<double> lengths;
  for (const Sighting& sighting : survey.sightings) {
    const double length = residual_px(survey, sighting).norm();
    lengths.push_back(std::isfinite(length) ? length : std::numeric_limits<double>::infinity());
  }
  std::nth_element(lengths.begin(),
                   lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 2),
                   lengths.end());
  return lengths[lengths.size() / 2];
}

Fit fit_from(double focal_px, Camera camera, const std::vector<Detection>& detections,
             const UsefulViews& useful, const std::vector<int>& ids, const BoardOptions& options) {
  camera.focal_px.setConstant(focal_px);
  Fit fit;
  fit.start = start_at(camera, detections, useful, ids);
  if (fit.start.taken.size() < useful.index.size()) return fit;
  try {
    fit.adjustment = adjust(fit.start.survey, adjustment_options(options));
    fit.rms_px = typical_error_px(fit.adjustment.survey);
  } catch (const SolverError&) {  // a bad start: the next one may do
  }
  return fit;
}

Fit best_fit(const Camera& camera, const std::vector<Detection>& detections,
             const UsefulViews& useful, const std::vector<int>& ids, const BoardOptions& options) {
  Fit best;
  if (camera.lens != Lens::fisheye) {
    if (const auto focal_px = focal_from_sheets(useful.views, camera.principal_px)) {
      best = fit_from(*focal_px, camera, detections, useful, ids, options);
    }
  }
  constexpr std::array widths{0.3, 0.45, 0.7, 1.0, 1.5, 2.5, 4.0};
  for (const double width : widths) {
    if (best.good(camera)) break;
    Fit fit = fit_from(width * camera.width, camera, detections, useful, ids, options);
    if (fit.rms_px < best.rms_px) best = std::move(fit);
  }
  if (best.good(camera)) return best;
  throw SolverError(fmt::format(
      "no camera with the lens '{}' explains the sheets: the best fit is {:.1f} px off. Is the "
      "sheet the one that --target names, flat, and the same in all pictures? A strongly curved "
      "picture needs --lens fisheye",
      lens_name(camera.lens), best.rms_px));
}

std::vector<int> ids_seen(const std::vector<Detection>& detections) {
  std::vector<int> ids;
  for (const Detection& detection : detections) {
    ids.insert(ids.end(), detection.ids.begin(), detection.ids.end());
  }
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  return ids;
}

std::vector<BoardView> views_of(const Fit& fit, const std::vector<std::string>& names) {
  std::vector<BoardView> views;
  for (const std::string& name : names) views.emplace_back().name = name;
  const Survey& survey = fit.adjustment.survey;
  for (std::size_t i = 0; i < survey.sightings.size(); ++i) {
    const auto placement = static_cast<std::size_t>(survey.sightings[i].placement);
    BoardView& view = views[static_cast<std::size_t>(fit.start.taken[placement])];
    ++view.points;
    view.outliers += fit.adjustment.outlier[i];
    view.rms_px += residual_px(survey, survey.sightings[i]).squaredNorm();
    view.camera_from_sheet = survey.world_from_target[placement];
  }
  for (BoardView& view : views) view.rms_px = std::sqrt(view.rms_px / std::max(view.points, 1));
  return views;
}

}  // namespace

BoardCalibration calibrate_board(const std::vector<Detection>& detections,
                                 const std::vector<std::string>& names,
                                 const BoardOptions& options) {
  if (detections.empty()) throw InvalidInput("there are no pictures to calibrate from");
  Camera camera = Camera::centred(detections[0].width, detections[0].height, 1.0);
  camera.camera_from_world = {};
  camera.lens = options.lens;
  camera.name = names[0];
  for (std::size_t i = 0; i < detections.size(); ++i) {
    check_not_mirrored(detections[i], names[i]);
    require_camera_size(camera, detections[i].width, detections[i].height, names[i]);
  }
  const UsefulViews useful = useful_views(detections, options.principal ? 3 : 2);
  BoardCalibration result;
  result.point_ids = ids_seen(detections);
  Fit fit = best_fit(camera, detections, useful, result.point_ids, options);
  fit.adjustment = with_circles_corrected(std::move(fit.adjustment), fit.start.radius_px);
  result.adjustment = fit.adjustment;
  result.adjustment.survey.cameras[0].name = "camera";  // until here the first picture, for errors
  result.camera = result.adjustment.survey.cameras[0];
  result.views = views_of(fit, names);
  result.view_of_placement = fit.start.taken;
  return result;
}

}  // namespace semblance
