#include "semblance/cameras/photo_calibration.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <map>

#include "rays.h"
#include "semblance/cameras/posit.h"
#include "semblance/core/errors.h"
#include "semblance/io/image_io.h"
#include "semblance/io/video.h"

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

// By those of the photo's marks whose points are roughly known.
Rigid3 rough_pose(const Camera& camera, const PhotoMarks& photo,
                  const std::vector<Eigen::Vector3d>& rough_points_m) {
  Eigen::Matrix3Xd points(3, photo.pixels_px.cols());
  Eigen::Matrix2Xd pixels(2, photo.pixels_px.cols());
  Eigen::Index known = 0;
  for (std::size_t k = 0; k < photo.points.size(); ++k) {
    const Eigen::Vector3d& point = rough_points_m[static_cast<std::size_t>(photo.points[k])];
    if (!point.allFinite()) continue;
    points.col(known) = point;
    pixels.col(known++) = photo.pixels_px.col(static_cast<Eigen::Index>(k));
  }
  const auto pose = pose_from_points(camera, points.leftCols(known), pixels.leftCols(known));
  if (pose) return *pose;
  throw InvalidInput(fmt::format(
      "{}: its {} marks of roughly known points give no pose; six or more that are not on a line "
      "are needed, and marks must carry the names of the points that they show",
      photo.name, known));
}

// Points of which nothing is known start where the rays of the photos meet; where they do not, the
// point's sightings are dropped.
void place_unknown_points(Survey& survey) {
  std::vector<Camera> cameras(survey.world_from_target.size(), survey.cameras[0]);
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    cameras[i].camera_from_world = survey.world_from_target[i];
  }
  std::map<int, std::vector<Ray>> rays;
  for (const Sighting& sighting : survey.sightings) {
    if (survey.points_m[static_cast<std::size_t>(sighting.point)].allFinite()) continue;
    rays[sighting.point].push_back(
        {&cameras[static_cast<std::size_t>(sighting.placement)], sighting.pixel_px});
  }
  for (const auto& [point, seen] : rays) {
    const auto place = seen.size() < 2 ? std::nullopt : point_from_rays(seen);
    survey.points_m[static_cast<std::size_t>(point)] = place.value_or(Eigen::Vector3d::Zero());
    if (place) continue;
    std::erase_if(survey.sightings,
                  [index = point](const Sighting& s) { return s.point == index; });
  }
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
  for (const PhotoMarks& photo : photos) {
    if (photo.width != camera.width || photo.height != camera.height) {
      throw InvalidInput(fmt::format(
          "{} has {} x {} pixels, but {} has {} x {}: photos of one "
          "camera must be of one size and upright alike",
          photo.name, photo.width, photo.height, photos[0].name, camera.width, camera.height));
    }
    const int placement = static_cast<int>(survey.world_from_target.size());
    for (std::size_t k = 0; k < photo.points.size(); ++k) {
      survey.sightings.push_back(
          {0, placement, photo.points[k], photo.pixels_px.col(static_cast<Eigen::Index>(k))});
    }
    survey.world_from_target.push_back(rough_pose(camera, photo, rough_points_m));
  }
  place_unknown_points(survey);
  return survey;
}

std::vector<PhotoMarks> photos_with_marks(const MarksFile& marks) {
  const std::vector<std::string> names = marks.names();
  std::vector<PhotoMarks> photos;
  for (const MarksFile::Photo& photo : marks.photos) {
    const Rgb8 image = read_image_rgb8(photo.file);
    PhotoMarks result{photo.file, image.width, image.height, {}, {}};
    result.pixels_px.resize(2, static_cast<Eigen::Index>(photo.marks_px.size()));
    for (const auto& [name, pixel] : photo.marks_px) {
      if (!(pixel.x() >= 0.0 && pixel.y() >= 0.0 && pixel.x() <= image.width &&
            pixel.y() <= image.height)) {
        throw InvalidInput(
            fmt::format("{}: mark '{}' at ({:g}, {:g}) is outside of its {} x {} "
                        "pixels",
                        photo.file, name, pixel.x(), pixel.y(), image.width, image.height));
      }
      result.pixels_px.col(static_cast<Eigen::Index>(result.points.size())) = pixel;
      const auto at = std::lower_bound(names.begin(), names.end(), name);
      result.points.push_back(static_cast<int>(at - names.begin()));
    }
    photos.push_back(std::move(result));
  }
  return photos;
}

Survey best_start_from_photos(const std::vector<PhotoMarks>& photos,
                              const std::vector<Eigen::Vector3d>& rough_points_m,
                              const PhotoOptions& options) {
  std::optional<Survey> best;
  double best_px = std::numeric_limits<double>::max();
  std::string failure = "no photos";
  for (const double factor : {0.7, 1.0, 1.5, 2.5, 4.0}) {
    try {
      const double side = photos.empty() ? 1.0 : std::max(photos[0].width, photos[0].height);
      Survey start = start_from_photos(photos, rough_points_m, factor * side, options);
      const double rms_px = calibrate_jointly(start, options).rms_px;
      if (rms_px >= best_px) continue;
      best_px = rms_px;
      best = std::move(start);
    } catch (const SolverError& error) {
      failure = error.what();
    }
  }
  if (!best) throw SolverError("the photos cannot be fitted: " + failure);
  return *best;
}

Survey survey_from_colmap(const ColmapModel& model) {
  if (model.cameras.size() != 1) {
    throw InvalidInput(
        fmt::format("the COLMAP model has {} cameras; one was expected", model.cameras.size()));
  }
  Survey survey;
  survey.cameras = {rig_from_colmap(model).cameras.at(0)};
  survey.cameras[0].camera_from_world = {};
  survey.cameras[0].name = "camera";
  std::map<std::uint64_t, int> index_of_point;
  for (const auto& [id, point] : model.points) {
    index_of_point[id] = static_cast<int>(survey.points_m.size());
    survey.points_m.push_back(point.position);
  }
  for (const auto& [id, image] : model.images) {
    const int placement = static_cast<int>(survey.world_from_target.size());
    survey.world_from_target.push_back(image.camera_from_world);
    for (const ColmapModel::Observation& seen : image.observations) {
      if (seen.point == ColmapModel::no_point) continue;
      survey.sightings.push_back({0, placement, index_of_point.at(seen.point), seen.pixel});
    }
  }
  return survey;
}

std::vector<Camera> cameras_of_photos(const Survey& survey, const std::vector<std::string>& names) {
  std::vector<Camera> cameras;
  for (std::size_t i = 0; i < names.size(); ++i) {
    cameras.push_back(survey.cameras[0]);
    cameras.back().name = names[i];
    cameras.back().camera_from_world = survey.world_from_target[i];
  }
  return cameras;
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
