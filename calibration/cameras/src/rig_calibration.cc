#include "semblance/cameras/rig_calibration.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "semblance/cameras/board_calibration.h"
#include "semblance/core/errors.h"
#include "semblance/io/picture_size.h"
#include "sheet_circles.h"
#include "sheet_start.h"
#include "sheet_views.h"

namespace semblance {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();

// A view whose sheet was placed before its camera.
struct PosedView {
  int view, camera, instant;
  SheetView points;
  Rigid3 camera_from_sheet;
};

BoardOptions board_options(const RigOptions& options) {
  BoardOptions board;
  board.lens = options.lens;
  board.aspect = options.aspect;
  board.principal = options.principal;
  board.cancelled = options.cancelled;
  return board;
}

Adjustment camera_by_itself(const std::vector<RigView>& views, int camera, const std::string& name,
                            const RigOptions& options) {
  std::vector<Detection> detections;
  std::vector<std::string> names;
  for (const RigView& view : views) {
    if (view.camera != camera) continue;
    detections.push_back(view.detection);
    names.push_back(view.name);
  }
  try {
    return calibrate_board(detections, names, board_options(options)).adjustment;
  } catch (const InvalidInput& error) {
    throw InvalidInput(
        fmt::format("camera '{}': {}. Or give its intrinsics in a file", name, error.what()));
  }
}

struct StartCamera {
  Camera camera;
  std::optional<double> alone_px;
};

StartCamera start_camera(const std::vector<RigView>& views, int index, const RigCamera& given,
                         const RigOptions& options) {
  StartCamera start;
  if (given.camera) {
    start.camera = *given.camera;
  } else {
    const Adjustment alone = camera_by_itself(views, index, given.name, options);
    start = {alone.survey.cameras[0], alone.rms_px};
  }
  start.camera.name = given.name;
  return start;
}

void check_sizes(const std::vector<RigView>& views, const std::vector<Camera>& cameras) {
  for (const RigView& view : views) {
    const Camera& camera = cameras[static_cast<std::size_t>(view.camera)];
    require_camera_size(camera, view.detection.width, view.detection.height, view.name);
  }
}

std::vector<PosedView> posed_views(const std::vector<RigView>& views,
                                   const std::vector<Camera>& cameras) {
  std::vector<PosedView> result;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const SheetView points = sheet_view(views[i].detection);
    if (points.sheet_m.cols() < kFewestPoints) continue;
    const Camera& camera = cameras[static_cast<std::size_t>(views[i].camera)];
    const auto pose = sheet_pose(camera, points);
    if (!pose) continue;
    result.push_back({static_cast<int>(i), views[i].camera, views[i].instant, points, *pose});
  }
  return result;
}

// b_from_a with how well it carries the sheets that a sees to where b sees them.
struct Link {
  Rigid3 b_from_a;
  double error_px = kInfinite;  // median over the instants that both see
  int points = 0;               // seen by both
  int lag = 0;                  // what b sees at instant i, a sees at i + lag
};

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

using SharedViews = std::vector<std::pair<const PosedView*, const PosedView*>>;

// Of the motions that single instants say, the one that suits most instants.
Link link_between(const SharedViews& shared, const Camera& camera_b) {
  constexpr std::size_t most_tried = 60;
  const std::size_t stride = 1 + shared.size() / most_tried;
  Link best;
  for (std::size_t i = 0; i < shared.size(); i += stride) {
    const Rigid3 b_from_a =
        shared[i].second->camera_from_sheet * shared[i].first->camera_from_sheet.inverse();
    std::vector<double> errors;
    for (std::size_t k = 0; k < shared.size(); k += stride) {
      const auto& [a, b] = shared[k];
      errors.push_back(sheet_error_px(camera_b, b_from_a * a->camera_from_sheet, b->points));
    }
    const double error_px = median(errors);
    if (error_px < best.error_px) best = {b_from_a, error_px};
  }
  for (const auto& [a, b] : shared) {
    best.points += static_cast<int>(std::min(a->points.sheet_m.cols(), b->points.sheet_m.cols()));
  }
  return best;
}

using ByInstant = std::map<int, const PosedView*>;

// What both see, where b's pictures show what a's showed `lag` instants later by their numbers.
SharedViews shared_views(const ByInstant& a, const ByInstant& b, int lag) {
  SharedViews shared;
  for (const auto& [instant, view] : b) {
    if (const auto found = a.find(instant + lag); found != a.end()) {
      shared.emplace_back(found->second, view);
    }
  }
  return shared;
}

// The link with the lag that suits best; a lag that leaves few instants in common may suit by
// chance and does not count.
Link best_link(const ByInstant& a, const ByInstant& b, int most_lag, const Camera& camera_b) {
  std::size_t most_shared = 0;
  for (int lag = -most_lag; lag <= most_lag; ++lag) {
    most_shared = std::max(most_shared, shared_views(a, b, lag).size());
  }
  Link best;
  for (int lag = -most_lag; lag <= most_lag; ++lag) {
    const SharedViews shared = shared_views(a, b, lag);
    if (shared.empty() || 2 * shared.size() < most_shared) continue;
    Link link = link_between(shared, camera_b);
    link.lag = lag;
    if (link.error_px < best.error_px) best = link;
  }
  return best;
}

using Links = std::map<std::pair<int, int>, Link>;

Links all_links(const std::vector<PosedView>& posed, const std::vector<Camera>& cameras,
                int most_lag) {
  std::vector<ByInstant> by_camera(cameras.size());
  for (const PosedView& view : posed) {
    by_camera[static_cast<std::size_t>(view.camera)].emplace(view.instant, &view);
  }
  Links links;
  for (std::size_t a = 0; a < cameras.size(); ++a) {
    for (std::size_t b = a + 1; b < cameras.size(); ++b) {
      const Link link = best_link(by_camera[a], by_camera[b], most_lag, cameras[b]);
      if (link.points == 0) continue;
      const int first = static_cast<int>(a), second = static_cast<int>(b);
      links[{first, second}] = link;
      links[{second, first}] = {link.b_from_a.inverse(), link.error_px, link.points, -link.lag};
    }
  }
  return links;
}

[[noreturn]] void report_missing_link(const std::vector<Camera>& cameras,
                                      const std::set<int>& reached) {
  std::vector<std::string> here, there;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    (reached.count(static_cast<int>(i)) != 0 ? here : there).push_back("'" + cameras[i].name + "'");
  }
  throw InvalidInput(fmt::format(
      "cameras {} and {} share no view of the sheet: no chain of common views links them. Show the "
      "sheet to one camera of each group at the same instant, or give poses for both",
      fmt::join(here, ", "), fmt::join(there, ", ")));
}

// Prim's tree: from the cameras placed so far always along the link with the most points. Gives the
// lag of each camera's clock.
std::vector<int> place_cameras(std::vector<Camera>& cameras, const std::vector<RigCamera>& known,
                               const Links& links) {
  std::vector<int> lags(cameras.size(), 0);
  std::set<int> reached;
  for (std::size_t i = 0; i < known.size(); ++i) {
    if (known[i].keep_pose) reached.insert(static_cast<int>(i));
  }
  if (reached.empty()) {
    cameras[0].camera_from_world = Camera::centred(1, 1, 1.0).camera_from_world;
    reached.insert(0);
  }
  while (reached.size() < cameras.size()) {
    const Link* best = nullptr;
    std::pair<int, int> pair;
    for (const auto& [candidate, link] : links) {
      const bool leads_on =
          reached.count(candidate.first) != 0 && reached.count(candidate.second) == 0;
      if (!leads_on || (best != nullptr && link.points <= best->points)) continue;
      best = &link;
      pair = candidate;
    }
    if (best == nullptr) report_missing_link(cameras, reached);
    cameras[static_cast<std::size_t>(pair.second)].camera_from_world =
        best->b_from_a * cameras[static_cast<std::size_t>(pair.first)].camera_from_world;
    lags[static_cast<std::size_t>(pair.second)] =
        lags[static_cast<std::size_t>(pair.first)] + best->lag;
    reached.insert(pair.second);
  }
  return lags;
}

// world_from_sheet of each instant: of the places that its views say, the one that suits all best.
std::map<int, Rigid3> place_sheets(const std::vector<PosedView>& posed,
                                   const std::vector<Camera>& cameras) {
  std::map<int, std::vector<const PosedView*>> by_instant;
  for (const PosedView& view : posed) by_instant[view.instant].push_back(&view);
  std::map<int, Rigid3> result;
  for (const auto& [instant, seen] : by_instant) {
    double least = kInfinite;
    for (const PosedView* candidate : seen) {
      const Rigid3 world_from_sheet =
          cameras[static_cast<std::size_t>(candidate->camera)].camera_from_world.inverse() *
          candidate->camera_from_sheet;
      double error_px = 0.0;
      for (const PosedView* view : seen) {
        const Camera& camera = cameras[static_cast<std::size_t>(view->camera)];
        error_px +=
            sheet_error_px(camera, camera.camera_from_world * world_from_sheet, view->points);
      }
      if (!(error_px < least)) continue;
      least = error_px;
      result[instant] = world_from_sheet;
    }
  }
  return result;
}

struct Start {
  Survey survey;
  std::vector<int> instants, point_ids, view_of_sighting;
  std::vector<double> radius_px;  // of each sighting's circle, if the sheet has circles
};

void add_view(const RigView& view, int view_index, int placement, bool needs_speed,
              const std::map<int, int>& point_of_id, Start& start) {
  for (std::size_t k = 0; k < view.detection.ids.size(); ++k) {
    const auto column = static_cast<Eigen::Index>(k);
    Sighting sighting{view.camera, placement, point_of_id.at(view.detection.ids[k]),
                      view.detection.points_px.col(column)};
    if (needs_speed) {
      if (column >= view.velocities_px_s.cols()) continue;
      sighting.velocity_px_s = view.velocities_px_s.col(column);
      if (!sighting.velocity_px_s.allFinite()) continue;
    }
    // A far start may put a point behind a camera; the adjustment has no use for it.
    if (!residual_px(start.survey, sighting).allFinite()) continue;
    start.survey.sightings.push_back(sighting);
    start.view_of_sighting.push_back(view_index);
    if (!view.detection.radii_px.empty()) start.radius_px.push_back(view.detection.radii_px[k]);
  }
}

Start start_from(const std::vector<RigView>& views, const std::vector<Camera>& cameras,
                 const std::map<int, Rigid3>& sheets, bool needs_speed) {
  Start start;
  start.survey.cameras = cameras;
  std::map<int, int> placement_of;
  for (const auto& [instant, pose] : sheets) {
    placement_of[instant] = static_cast<int>(start.instants.size());
    start.instants.push_back(instant);
    start.survey.world_from_target.push_back(pose);
  }
  std::map<int, int> point_of_id;
  for (const RigView& view : views) {
    for (const int id : view.detection.ids) {
      if (!point_of_id.emplace(id, static_cast<int>(start.point_ids.size())).second) continue;
      start.point_ids.push_back(id);
      start.survey.points_m.push_back(point_on_sheet(view.detection.target, id));
    }
  }
  for (std::size_t i = 0; i < views.size(); ++i) {
    const auto placement = placement_of.find(views[i].instant);
    if (placement == placement_of.end()) continue;
    add_view(views[i], static_cast<int>(i), placement->second, needs_speed, point_of_id, start);
  }
  return start;
}

AdjustmentOptions adjustment_options(const std::vector<RigCamera>& cameras,
                                     const RigOptions& options) {
  AdjustmentOptions result;
  const bool any_kept = std::any_of(cameras.begin(), cameras.end(),
                                    [](const RigCamera& camera) { return camera.keep_pose; });
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    CameraFreedom freedom = CameraFreedom::pose_only();
    if (!cameras[i].keep_intrinsics) {
      freedom = {.aspect = options.aspect, .principal = options.principal};
    }
    const bool is_frame = !any_kept && i == 0;
    freedom.pose = !cameras[i].keep_pose && !is_frame;
    freedom.time_offset = options.time_offsets && i > 0;
    result.cameras.push_back(freedom);
  }
  result.warp = options.warp;
  if (options.keep_outliers) result.outlier_sigmas.reset();
  result.cancelled = options.cancelled;
  return result;
}

std::vector<RigCameraFit> fits_of(const Adjustment& adjustment, const Start& start) {
  const Survey& survey = adjustment.survey;
  std::vector<RigCameraFit> fits(survey.cameras.size());
  std::vector<std::set<int>> views(fits.size());
  for (std::size_t i = 0; i < survey.sightings.size(); ++i) {
    const auto camera = static_cast<std::size_t>(survey.sightings[i].camera);
    ++fits[camera].points;
    views[camera].insert(start.view_of_sighting[i]);
    if (adjustment.outlier[i]) {
      ++fits[camera].outliers;
    } else {
      fits[camera].rms_px += residual_px(survey, survey.sightings[i]).squaredNorm();
    }
  }
  for (std::size_t c = 0; c < fits.size(); ++c) {
    fits[c].views = static_cast<int>(views[c].size());
    fits[c].rms_px = std::sqrt(fits[c].rms_px / std::max(fits[c].points - fits[c].outliers, 1));
  }
  return fits;
}

}  // namespace

std::string disagreement(const RigCalibration& rig) {
  constexpr double much_worse = 2.0;
  std::vector<std::string> worse;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const RigCameraFit& fit = rig.fits[c];
    if (!fit.alone_px || fit.rms_px <= much_worse * *fit.alone_px) continue;
    worse.push_back(fmt::format("{} fits {:.2f} px in the rig, {:.2f} px by itself",
                                rig.cameras[c].name, fit.rms_px, *fit.alone_px));
  }
  return fmt::format("{}", fmt::join(worse, ", "));
}

RigCalibration calibrate_rig(const std::vector<RigView>& given,
                             const std::vector<RigCamera>& cameras, const RigOptions& options) {
  std::vector<RigView> views = given;
  std::vector<Camera> start;
  std::vector<std::optional<double>> alone_px;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const StartCamera known = start_camera(views, static_cast<int>(i), cameras[i], options);
    start.push_back(known.camera);
    alone_px.push_back(known.alone_px);
  }
  check_sizes(views, start);
  std::vector<PosedView> posed = posed_views(views, start);
  const int most_lag = options.time_offsets ? options.most_lag : 0;
  const std::vector<int> lags = place_cameras(start, cameras, all_links(posed, start, most_lag));
  for (RigView& view : views) view.instant += lags[static_cast<std::size_t>(view.camera)];
  for (PosedView& view : posed) view.instant += lags[static_cast<std::size_t>(view.camera)];
  const Start survey = start_from(views, start, place_sheets(posed, start), options.time_offsets);
  RigCalibration result;
  result.adjustment = with_circles_corrected(
      adjust(survey.survey, adjustment_options(cameras, options)), survey.radius_px);
  for (std::size_t i = 0; i < lags.size(); ++i) {
    result.time_offset_s.push_back(lags[i] * options.step_s +
                                   result.adjustment.survey.time_offset_s[i]);
  }
  result.cameras = result.adjustment.survey.cameras;
  result.fits = fits_of(result.adjustment, survey);
  for (std::size_t i = 0; i < alone_px.size(); ++i) result.fits[i].alone_px = alone_px[i];
  result.instants = survey.instants;
  result.point_ids = survey.point_ids;
  result.view_of_sighting = survey.view_of_sighting;
  return result;
}

}  // namespace semblance
