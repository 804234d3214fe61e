#include "semblance/cameras/photo_calibration.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <map>

#include "rays.h"
#include "semblance/cameras/posit.h"
#include "semblance/cameras/scene_frame.h"
#include "semblance/core/errors.h"
#include "semblance/io/image_io.h"
#include "semblance/io/picture_size.h"
#include "semblance/io/video.h"
#include "shape_from_views.h"

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

// Where nothing is known of the scale, the length between the first point seen and the one farthest
// from it is kept: an unknown scale would leave the equations without a single solution.
std::vector<KnownLength> scale_of(const Survey& survey, const PhotoOptions& options) {
  if (!options.lengths.empty() || !options.known_points.empty()) return options.lengths;
  if (survey.sightings.empty()) return {};
  const int first = survey.sightings[0].point;  // one that has a place
  KnownLength kept{first, first, 0.0, 0.0};
  for (const Sighting& sighting : survey.sightings) {
    const double length_m = (survey.points_m[static_cast<std::size_t>(sighting.point)] -
                             survey.points_m[static_cast<std::size_t>(first)])
                                .norm();
    if (length_m > kept.length_m) kept = {first, sighting.point, length_m, 1e-4 * length_m};
  }
  return {kept};
}

// What a joint adjustment of cameras and points has in common, whatever the cameras' layout.
AdjustmentOptions joint_options(const Survey& start, const PhotoOptions& options) {
  AdjustmentOptions all;
  all.points = true;
  all.lengths = scale_of(start, options);
  all.known_points = options.known_points;
  all.max_iterations = 300;
  if (options.keep_outliers) all.outlier_sigmas.reset();
  all.cancelled = options.cancelled;
  return all;
}

PhotoCalibration solve_jointly(const Survey& start, const AdjustmentOptions& options) {
  PhotoCalibration result;
  result.adjustment = adjust(start, options);
  result.survey = result.adjustment->survey;
  result.rounds = result.adjustment->iterations;
  result.rms_px = result.adjustment->rms_px;
  result.converged = result.adjustment->converged;
  result.solve_s = result.adjustment->solve_s;
  return result;
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
  std::map<std::pair<int, int>, Camera> cameras;  // in the points' frame, by camera and placement
  std::map<int, std::vector<Ray>> rays;
  for (const Sighting& sighting : survey.sightings) {
    if (survey.points_m[static_cast<std::size_t>(sighting.point)].allFinite()) continue;
    const Camera& camera = survey.cameras[static_cast<std::size_t>(sighting.camera)];
    Camera& view = cameras.try_emplace({sighting.camera, sighting.placement}, camera).first->second;
    view.camera_from_world = camera.camera_from_world *
                             survey.world_from_target[static_cast<std::size_t>(sighting.placement)];
    rays[sighting.point].push_back({&view, sighting.pixel_px});
  }
  for (const auto& [point, seen] : rays) {
    const auto place = seen.size() < 2 ? std::nullopt : point_from_rays(seen);
    survey.points_m[static_cast<std::size_t>(point)] = place.value_or(Eigen::Vector3d::Zero());
    if (place) continue;
    std::erase_if(survey.sightings,
                  [index = point](const Sighting& s) { return s.point == index; });
  }
}

void require_two(const std::vector<PhotoMarks>& photos) {
  if (photos.size() >= 2) return;
  throw InvalidInput(
      "points in space need two photos at least, better three or more from "
      "different sides");
}

void add_sightings(const PhotoMarks& photo, int camera, int placement, Survey& survey) {
  for (std::size_t k = 0; k < photo.points.size(); ++k) {
    survey.sightings.push_back(
        {camera, placement, photo.points[k], photo.pixels_px.col(static_cast<Eigen::Index>(k))});
  }
}

// Into the frame of the known points, which must have a place.
void move_to_known_points(const std::vector<KnownPoint>& known, const std::vector<char>& placed,
                          Survey& survey) {
  std::vector<Eigen::Vector3d> from, to;
  for (const KnownPoint& point : known) {
    const auto at = static_cast<std::size_t>(point.point);
    if (!placed[at]) continue;
    from.push_back(survey.points_m[at]);
    to.push_back(point.position_m);
  }
  const Similarity move = similarity_between(from, to);
  for (std::size_t i = 0; i < survey.points_m.size(); ++i) {
    if (placed[i]) survey.points_m[i] = move * survey.points_m[i];
  }
  for (Rigid3& pose : survey.world_from_target) pose = moved_pose(move, pose);
}

// The shape that the photos show, with a placement for each photo.
Survey whole_survey(const ShapeFromViews& finder, const std::vector<PhotoMarks>& photos,
                    std::size_t points, const PhotoOptions& options) {
  const Reconstruction shape = finder.best_start();
  const ShapeSurvey found = finder.survey_of(shape);
  Survey survey;
  survey.cameras = found.survey.cameras;
  survey.cameras[0].lens = options.lens;
  survey.points_m.assign(points, Eigen::Vector3d::Zero());
  std::vector<char> placed(points, 0);
  for (std::size_t k = 0; k < found.tracks.size(); ++k) {
    const auto at = static_cast<std::size_t>(found.tracks[k]);
    survey.points_m[at] = found.survey.points_m[k];
    placed[at] = 1;
  }
  for (std::size_t i = 0; i < photos.size(); ++i) {
    const auto pose = shape.camera_from_object.find(static_cast<int>(i));
    if (pose == shape.camera_from_object.end()) {
      throw SolverError(fmt::format(
          "{}: its {} marks do not place it against the other photos; six of them must be marks "
          "that two others show, and carry the names of the points that they show",
          photos[i].name, photos[i].points.size()));
    }
    survey.world_from_target.push_back(pose->second);
  }
  for (Sighting sighting : found.survey.sightings) {
    sighting.placement = found.views[static_cast<std::size_t>(sighting.placement)];
    sighting.point = found.tracks[static_cast<std::size_t>(sighting.point)];
    survey.sightings.push_back(sighting);
  }
  if (!options.known_points.empty()) move_to_known_points(options.known_points, placed, survey);
  return survey;
}

}  // namespace

Survey start_from_photos(const std::vector<PhotoMarks>& photos,
                         const std::vector<Eigen::Vector3d>& rough_points_m, double focal_px,
                         const PhotoOptions& options) {
  require_two(photos);
  Survey survey;
  Camera camera = Camera::centred(photos[0].width, photos[0].height, focal_px);
  camera.camera_from_world = {};
  camera.lens = options.lens;
  survey.cameras = {camera};
  survey.points_m = rough_points_m;
  camera.name = photos[0].name;  // for errors
  for (const PhotoMarks& photo : photos) {
    require_camera_size(camera, photo.width, photo.height, photo.name);
    add_sightings(photo, 0, static_cast<int>(survey.world_from_target.size()), survey);
    survey.world_from_target.push_back(rough_pose(camera, photo, rough_points_m));
  }
  place_unknown_points(survey);
  return survey;
}

Survey start_from_marks_alone(const std::vector<PhotoMarks>& photos, std::size_t points,
                              const PhotoOptions& options) {
  constexpr std::size_t fewest_photos = 3;
  if (photos.size() < fewest_photos) {
    throw InvalidInput(fmt::format(
        "{} photos; without roughly known points three are needed at least, from different sides",
        photos.size()));
  }
  Camera camera = Camera::centred(photos[0].width, photos[0].height, photos[0].width);
  camera.camera_from_world = {};
  Camera first = camera;
  first.name = photos[0].name;  // for errors
  std::vector<TrackView> views;
  for (const PhotoMarks& photo : photos) {
    require_camera_size(first, photo.width, photo.height, photo.name);
    TrackView& view = views.emplace_back();
    for (std::size_t k = 0; k < photo.points.size(); ++k) {
      view[photo.points[k]].pixel_px = photo.pixels_px.col(static_cast<Eigen::Index>(k));
    }
  }
  ShapeOptions shape_options;
  const double side_px = std::max(camera.width, camera.height);
  for (const double factor : {0.6, 0.85, 1.2, 1.7, 2.4, 3.5}) {
    shape_options.focals_px.push_back(factor * side_px);
  }
  shape_options.accuracy_px = std::max(2.0, 0.003 * side_px);  // of a click
  shape_options.fewest_views = 2;
  shape_options.cancelled = options.cancelled;
  const ShapeFromViews finder(camera, std::move(views), shape_options);
  if (finder.most_shared() < ShapeFromViews::fewest_shared) {
    throw InvalidInput(fmt::format(
        "the two photos that share most marks share {}; without roughly known points {} are "
        "needed. Mark more points, or give six 'points' roughly",
        finder.most_shared(), ShapeFromViews::fewest_shared));
  }
  return whole_survey(finder, photos, points, options);
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
  constexpr int fewest_rough = 6;
  if (std::count_if(rough_points_m.begin(), rough_points_m.end(),
                    [](const Eigen::Vector3d& p) { return p.allFinite(); }) < fewest_rough) {
    return start_from_marks_alone(photos, rough_points_m.size(), options);
  }
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

PhotoCalibration calibrate_with_lenses(const std::vector<Camera>& cameras,
                                       const std::vector<PhotoMarks>& photos,
                                       const std::vector<Eigen::Vector3d>& rough_points_m,
                                       const PhotoOptions& options) {
  require_two(photos);
  Survey survey;
  survey.cameras = cameras;
  survey.world_from_target = {Rigid3{}};
  survey.points_m = rough_points_m;
  for (std::size_t i = 0; i < photos.size(); ++i) {
    require_camera_size(cameras[i], photos[i].width, photos[i].height, photos[i].name);
    add_sightings(photos[i], static_cast<int>(i), 0, survey);
    Camera& camera = survey.cameras[i];
    camera.camera_from_world = {};
    camera.camera_from_world = rough_pose(camera, photos[i], rough_points_m);
  }
  place_unknown_points(survey);
  AdjustmentOptions all = joint_options(survey, options);
  all.cameras.assign(cameras.size(), CameraFreedom::pose_only());
  if (options.known_points.empty()) all.cameras[0] = CameraFreedom::none();
  all.placements = false;
  return solve_jointly(survey, all);
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
  points.known_points = options.known_points;
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
  AdjustmentOptions all = joint_options(start, options);
  all.cameras = {freedom_of(options)};
  if (options.known_points.empty()) all.kept_placement = 0;
  return solve_jointly(start, all);
}

}  // namespace semblance
