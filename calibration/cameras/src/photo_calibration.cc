#include "semblance/cameras/photo_calibration.h"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <limits>

#include "semblance/cameras/posit.h"
#include "semblance/core/errors.h"
#include "semblance/io/picture_size.h"

namespace semblance {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

CameraFreedom freedom_of(const PhotoOptions& options) {
  CameraFreedom freedom;
  freedom.aspect = false;
  freedom.principal = options.principal;
  freedom.pose = false;
  return freedom;
}

// Where no length is known, that between the first point and the one farthest from it is kept: an
// unknown scale would leave the equations without a single solution.
std::vector<KnownLength> scale_of(const Survey& survey, const PhotoOptions& options) {
  if (!options.lengths.empty()) return options.lengths;
  KnownLength kept{0, 0, 0.0, 0.0};
  for (std::size_t i = 1; i < survey.points_m.size(); ++i) {
    const double length_m = (survey.points_m[i] - survey.points_m[0]).norm();
    if (length_m > kept.length_m) kept = {0, static_cast<int>(i), length_m, 1e-4 * length_m};
  }
  return {kept};
}

AdjustmentOptions half_step(const PhotoOptions& options) {
  AdjustmentOptions half;
  half.outlier_sigmas.reset();
  half.covariance = false;
  half.max_iterations = 20;
  half.cancelled = options.cancelled;
  return half;
}

}  // namespace

Survey start_from_photos(const std::vector<PhotoMarks>& photos,
                         const std::vector<Eigen::Vector3d>& rough_points_m, double focal_px,
                         const PhotoOptions& options) {
  if (photos.size() < 2) {
    throw InvalidInput(
        "points in space need two photos at least, better three or more from "
        "different sides");
  }
  Survey survey;
  Camera camera = Camera::centred(photos[0].width, photos[0].height, focal_px);
  camera.camera_from_world = {};
  camera.lens = options.lens;
  survey.cameras = {camera};
  survey.points_m = rough_points_m;
  camera.name = photos[0].name;  // for errors
  for (const PhotoMarks& photo : photos) {
    require_camera_size(camera, photo.width, photo.height, photo.name);
    Eigen::Matrix3Xd points(3, photo.pixels_px.cols());
    const int placement = static_cast<int>(survey.world_from_target.size());
    for (Eigen::Index k = 0; k < points.cols(); ++k) {
      const int point = photo.points[static_cast<std::size_t>(k)];
      points.col(k) = rough_points_m[static_cast<std::size_t>(point)];
      survey.sightings.push_back({0, placement, point, photo.pixels_px.col(k)});
    }
    const auto pose = pose_from_points(camera, points, photo.pixels_px);
    if (!pose) {
      throw InvalidInput(fmt::format(
          "{}: its {} marks give no pose; six or more that are not on a line are needed, and marks "
          "must carry the names of the points that they show",
          photo.name, photo.points.size()));
    }
    survey.world_from_target.push_back(*pose);
  }
  return survey;
}

PhotoCalibration calibrate_by_loop(const Survey& start, const PhotoOptions& options) {
  const Clock::time_point begin = Clock::now();
  AdjustmentOptions cameras = half_step(options), points = half_step(options);
  cameras.cameras = {freedom_of(options)};
  points.cameras = {CameraFreedom::none()};
  points.placements = false;
  points.points = true;
  points.lengths = scale_of(start, options);
  PhotoCalibration result;
  result.survey = start;
  // A round that gains less than this share has arrived at the noise.
  constexpr double least_gain = 1e-7;
  for (double before = std::numeric_limits<double>::max(); result.rounds < options.most_rounds;) {
    ++result.rounds;
    result.survey = adjust(result.survey, cameras).survey;
    const Adjustment found = adjust(result.survey, points);
    result.survey = found.survey;
    result.rms_px = found.rms_all_px;
    result.converged = before - result.rms_px <= least_gain * before;
    if (result.converged || (options.cancelled && options.cancelled())) break;
    before = result.rms_px;
  }
  result.solve_s = seconds_since(begin);
  return result;
}

PhotoCalibration calibrate_jointly(const Survey& start, const PhotoOptions& options) {
  AdjustmentOptions all;
  all.cameras = {freedom_of(options)};
  all.points = true;
  all.kept_placement = 0;
  all.lengths = scale_of(start, options);
  all.max_iterations = 300;
  if (options.keep_outliers) all.outlier_sigmas.reset();
  all.cancelled = options.cancelled;
  PhotoCalibration result;
  result.adjustment = adjust(start, all);
  result.survey = result.adjustment->survey;
  result.rounds = result.adjustment->iterations;
  result.rms_px = result.adjustment->rms_px;
  result.converged = result.adjustment->converged;
  result.solve_s = result.adjustment->solve_s;
  return result;
}

}  // namespace semblance
