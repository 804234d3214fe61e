#include "shape_from_views.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <set>
#include <utility>

#include "rays.h"
#include "semblance/cameras/photo_calibration.h"
#include "semblance/core/errors.h"

namespace semblance {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr std::size_t kMostPairs = 6, kFewestSightings = 24;
constexpr double kRansac = 1.5, kPose = 4.0;  // in accuracies of points
constexpr double kLeastAngle = 0.03;          // rad, between rays that place a point

cv::Point2d cv_point(const Vector2d& v) { return {v.x(), v.y()}; }

Vector2d direction(const Camera& camera, const TrackedPoint& point) {
  return unproject(camera, point.pixel_px).head<2>();
}

}  // namespace

ShapeFromViews::ShapeFromViews(Camera camera, std::vector<TrackView> views, ShapeOptions options)
    : camera_(std::move(camera)), views_(std::move(views)), options_(std::move(options)) {}

std::size_t ShapeFromViews::most_shared() const {
  std::size_t most = 0;
  for (std::size_t a = 0; a < views_.size(); ++a) {
    for (std::size_t b = a + 1; b < views_.size(); ++b) {
      most = std::max(most, shared(views_[a], views_[b]).size());
    }
  }
  return most;
}

std::vector<int> ShapeFromViews::shared(const TrackView& a, const TrackView& b) const {
  std::vector<int> result;
  for (const auto& [track, seen] : a) {
    if (b.count(track) != 0) result.push_back(track);
  }
  return result;
}

/// How far the points of two views move against each other, px: what is left of their motion when
/// the best affine map is taken out, which only their depth can cause.
double ShapeFromViews::parallax_px(const TrackView& a, const TrackView& b,
                                   const std::vector<int>& tracks) const {
  Eigen::MatrixX3d from(tracks.size(), 3);
  Eigen::MatrixX2d to(tracks.size(), 2);
  for (std::size_t k = 0; k < tracks.size(); ++k) {
    const auto row = static_cast<Eigen::Index>(k);
    from.row(row) = a.at(tracks[k]).pixel_px.homogeneous().transpose();
    to.row(row) = b.at(tracks[k]).pixel_px.transpose();
  }
  const Eigen::MatrixX2d left = to - from * from.colPivHouseholderQr().solve(to);
  return std::sqrt(left.squaredNorm() / static_cast<double>(tracks.size()));
}

/// Pairs of views with many common points and much parallax, the best first.
std::vector<ShapeFromViews::Pair> ShapeFromViews::start_pairs() const {
  std::vector<Pair> pairs;
  for (int a = 0; a < static_cast<int>(views_.size()); ++a) {
    for (int b = a + 1; b < static_cast<int>(views_.size()); ++b) {
      const TrackView &first = view(a), &second = view(b);
      const std::vector<int> common = shared(first, second);
      if (common.size() < fewest_shared) continue;
      pairs.push_back(
          {a, b,
           parallax_px(first, second, common) * std::sqrt(static_cast<double>(common.size()))});
    }
  }
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const Pair& x, const Pair& y) { return x.score > y.score; });
  if (pairs.size() > kMostPairs) pairs.resize(kMostPairs);
  return pairs;
}

Reconstruction ShapeFromViews::best_start() const {
  const std::vector<Pair> pairs = start_pairs();
  Reconstruction best;
  int most_good = 0;
  for (const double focal_px : options_.focals_px) {
    for (const Pair& pair : pairs) {
      if (options_.cancelled && options_.cancelled()) {
        throw SolverError("interrupted while the start was sought");
      }
      Camera camera = camera_;
      camera.focal_px.setConstant(focal_px);
      Reconstruction shape;
      if (!start_from_pair(camera, pair, shape)) continue;
      try {
        extend(shape);
        shape = adjusted(shape, Lens::pinhole);
      } catch (const SolverError&) {  // a wrong start
        continue;
      }
      const int good = good_sightings(shape);
      if (good <= most_good) continue;
      most_good = good;
      best = std::move(shape);
    }
  }
  int all = 0;
  for (const TrackView& view : views_) all += static_cast<int>(view.size());
  constexpr double fewest_share = 0.4;
  if (most_good < fewest_share * all || best.points.size() < fewest_shared) {
    throw SolverError(fmt::format(
        "the points do not move as one rigid body seen by one camera (at most {} of {} sightings "
        "fit within {:.1f} px): is the object rigid, is it seen from different sides, and is the "
        "zoom fixed?",
        most_good, all, options_.accuracy_px));
  }
  return best;
}

bool ShapeFromViews::start_from_pair(const Camera& camera, const Pair& pair,
                                     Reconstruction& shape) const {
  const TrackView &a = view(pair.a), &b = view(pair.b);
  std::vector<cv::Point2d> from, to;
  for (const int track : shared(a, b)) {
    from.push_back(cv_point(direction(camera, a.at(track))));
    to.push_back(cv_point(direction(camera, b.at(track))));
  }
  cv::Mat mask, turn, shift;
  constexpr double confidence = 0.999;
  const cv::Mat essential =
      cv::findEssentialMat(from, to, cv::Mat::eye(3, 3, CV_64F), cv::RANSAC, confidence,
                           kRansac * options_.accuracy_px / camera.focal_px.x(), mask);
  if (essential.rows != 3 || essential.cols != 3) return false;
  const int front =
      cv::recoverPose(essential, from, to, cv::Mat::eye(3, 3, CV_64F), turn, shift, mask);
  if (front < static_cast<int>(fewest_shared) - 1) return false;
  Matrix3d rotation;
  Vector3d translation;
  cv::cv2eigen(turn, rotation);
  cv::cv2eigen(shift, translation);
  shape.camera = camera;
  shape.camera_from_object[pair.a] = {};
  shape.camera_from_object[pair.b] = {Eigen::Quaterniond(rotation), translation};
  triangulate(shape);
  return shape.points.size() >= fewest_shared - 1;
}

/// The place of a point from all views that have a pose, where their rays differ enough.
std::optional<Vector3d> ShapeFromViews::place_of(const Reconstruction& shape, int track) const {
  std::vector<Camera> cameras;
  std::vector<Vector2d> pixels_px;
  for (const auto& [index, pose] : shape.camera_from_object) {
    const auto seen = view(index).find(track);
    if (seen == view(index).end()) continue;
    cameras.push_back(shape.camera);
    cameras.back().camera_from_world = pose;
    pixels_px.push_back(seen->second.pixel_px);
  }
  std::vector<Ray> rays;
  for (std::size_t i = 0; i < cameras.size(); ++i) rays.push_back({&cameras[i], pixels_px[i]});
  const auto point = rays.size() < 2 ? std::nullopt : point_from_rays(rays, kLeastAngle);
  if (!point) return std::nullopt;
  const bool in_front = std::all_of(cameras.begin(), cameras.end(), [&](const Camera& camera) {
    return (camera.camera_from_world * *point).z() > 0.0;
  });
  return in_front ? point : std::nullopt;
}

double ShapeFromViews::error_px(const Reconstruction& shape, int index, int track,
                                const Vector3d& point) const {
  const Vector3d seen = shape.camera_from_object.at(index) * point;
  if (!(seen.z() > 0.0)) return std::numeric_limits<double>::infinity();
  return (project(shape.camera, seen) - view(index).at(track).pixel_px).norm();
}

void ShapeFromViews::triangulate(Reconstruction& shape) const {
  std::set<int> unknown;
  for (const auto& [index, pose] : shape.camera_from_object) {
    for (const auto& [track, seen] : view(index)) {
      if (shape.points.count(track) == 0) unknown.insert(track);
    }
  }
  for (const int track : unknown) {
    const auto point = place_of(shape, track);
    if (!point) continue;
    std::vector<double> errors;
    for (const auto& [index, pose] : shape.camera_from_object) {
      if (view(index).count(track) == 0) continue;
      errors.push_back(error_px(shape, index, track, *point));
    }
    std::sort(errors.begin(), errors.end());
    if (errors[errors.size() / 2] < kPose * options_.accuracy_px) shape.points[track] = *point;
  }
}

std::optional<Rigid3> ShapeFromViews::pose_of(const Reconstruction& shape,
                                              const TrackView& view) const {
  constexpr int fewest = 6, rounds = 200;
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> directions;
  for (const auto& [track, point] : view) {
    const auto found = shape.points.find(track);
    if (found == shape.points.end()) continue;
    points.emplace_back(found->second.x(), found->second.y(), found->second.z());
    directions.push_back(cv_point(direction(shape.camera, point)));
  }
  if (static_cast<int>(points.size()) < fewest) return std::nullopt;
  cv::Mat turn, shift;
  std::vector<int> inliers;
  const auto reach = static_cast<float>(kPose * options_.accuracy_px / shape.camera.focal_px.x());
  constexpr double confidence = 0.999;
  const bool found =
      cv::solvePnPRansac(points, directions, cv::Matx33d::eye(), cv::noArray(), turn, shift, false,
                         rounds, reach, confidence, inliers, cv::SOLVEPNP_SQPNP);
  if (!found || 2 * inliers.size() < points.size()) return std::nullopt;
  Vector3d rotation, translation;
  cv::cv2eigen(turn, rotation);
  cv::cv2eigen(shift, translation);
  if (!rotation.allFinite() || !translation.allFinite()) return std::nullopt;
  return Rigid3{quaternion_from_rotation_vector(rotation), translation};
}

void ShapeFromViews::extend(Reconstruction& shape) const {
  std::set<int> failed;
  triangulate(shape);
  while (true) {
    int best = -1, most = 0;
    for (int i = 0; i < static_cast<int>(views_.size()); ++i) {
      if (shape.camera_from_object.count(i) != 0 || failed.count(i) != 0) continue;
      int known = 0;
      for (const auto& [track, seen] : view(i)) {
        known += static_cast<int>(shape.points.count(track));
      }
      if (known <= most) continue;
      most = known;
      best = i;
    }
    if (best < 0) return;
    const auto pose = pose_of(shape, view(best));
    if (!pose) {
      failed.insert(best);
      continue;
    }
    shape.camera_from_object[best] = *pose;
    triangulate(shape);
    failed.clear();
  }
}

ShapeSurvey ShapeFromViews::survey_of(const Reconstruction& shape) const {
  ShapeSurvey result;
  result.survey.cameras = {shape.camera};
  std::map<int, int> views_of_track, index_of_track;
  for (const auto& [index, pose] : shape.camera_from_object) {
    for (const auto& [track, seen] : view(index)) {
      ++views_of_track[track];
    }
  }
  for (const auto& [track, point] : shape.points) {
    if (views_of_track[track] < options_.fewest_views) continue;
    index_of_track[track] = static_cast<int>(result.tracks.size());
    result.tracks.push_back(track);
    result.survey.points_m.push_back(point);
  }
  for (const auto& [index, pose] : shape.camera_from_object) {
    const auto placement = static_cast<int>(result.views.size());
    result.survey.world_from_target.push_back(pose);
    result.views.push_back(index);
    for (const auto& [track, seen] : view(index)) {
      const auto point = index_of_track.find(track);
      if (point == index_of_track.end()) continue;
      const Sighting sighting{.placement = placement,
                              .point = point->second,
                              .pixel_px = seen.pixel_px,
                              .spread = seen.spread};
      if (!residual_px(result.survey, sighting).allFinite()) continue;
      result.survey.sightings.push_back(sighting);
      result.indices.push_back(seen.index);
    }
  }
  return result;
}

Reconstruction ShapeFromViews::adjusted(const Reconstruction& shape, Lens lens) const {
  ShapeSurvey start = survey_of(shape);
  if (start.survey.sightings.size() < kFewestSightings) {
    throw SolverError("too few points could be placed: the pictures differ too little or too much");
  }
  start.survey.cameras[0].lens = lens;
  PhotoOptions photo;
  photo.lens = lens;
  photo.cancelled = options_.cancelled;
  const PhotoCalibration found = calibrate_jointly(start.survey, photo);
  const double focal = found.survey.cameras[0].focal_px.x() / camera_.width;
  if (!(focal > 0.2 && focal < 20.0)) throw SolverError("the focal length ran away");
  Reconstruction result;
  result.camera = found.survey.cameras[0];
  std::vector<int> support(start.tracks.size(), 0), kept(start.views.size(), 0);
  for (std::size_t i = 0; i < found.survey.sightings.size(); ++i) {
    if (found.adjustment->outlier[i] != 0) continue;
    ++support[static_cast<std::size_t>(found.survey.sightings[i].point)];
    ++kept[static_cast<std::size_t>(found.survey.sightings[i].placement)];
  }
  for (std::size_t i = 0; i < start.tracks.size(); ++i) {
    if (support[i] >= options_.fewest_views)
      result.points[start.tracks[i]] = found.survey.points_m[i];
  }
  constexpr int fewest = 5;
  for (std::size_t i = 0; i < start.views.size(); ++i) {
    if (kept[i] >= fewest) {
      result.camera_from_object[start.views[i]] = found.survey.world_from_target[i];
    }
  }
  return result;
}

int ShapeFromViews::good_sightings(const Reconstruction& shape) const {
  int good = 0;
  for (const auto& [index, pose] : shape.camera_from_object) {
    for (const auto& [track, seen] : view(index)) {
      const auto point = shape.points.find(track);
      if (point != shape.points.end() &&
          error_px(shape, index, track, point->second) < options_.accuracy_px) {
        ++good;
      }
    }
  }
  return good;
}

}  // namespace semblance
