#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <set>

#include "marker_views.h"
#include "semblance/cameras/dot_tracks.h"
#include "semblance/cameras/photo_calibration.h"
#include "semblance/core/errors.h"

namespace semblance {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kFewestTracks = 8;    // that two pictures share
constexpr int kStartPictures = 12;  // that the start is sought in
constexpr int kMostPictures = 40;   // in the adjustment
constexpr int kFewestViews = 3;     // of a dot
constexpr std::size_t kMostPairs = 6, kFewestSightings = 24;
constexpr double kGood_px = 1.0, kRansac_px = 1.5, kPose_px = 4.0;
constexpr double kLeastAngle = 0.03;  // rad, between rays that place a dot
constexpr int kCorrections = 2;
// Focal lengths in widths of the picture, from wide angle to tele.
const std::vector<double> kUsualFocals{0.6, 0.85, 1.2, 1.7, 2.4};

/// What one picture shows: tracks and where they are.
struct View {
  int picture = 0;
  std::map<int, int> dot_of_track;
};

using Points = std::map<int, Vector3d>;  // by track

/// A shape with the poses of the views that it was made of.
struct Reconstruction {
  Camera camera;
  std::map<int, Rigid3> camera_from_object;  // by index of the view
  Points points;
};

class UnknownSolver {
 public:
  UnknownSolver(const std::vector<MarkerPicture>& pictures, const std::string& name,
                const MarkerOptions& options)
      : pictures_(pictures), options_(options) {
    camera_ = Camera::centred(pictures[0].width, pictures[0].height, pictures[0].width);
    camera_.camera_from_world = {};
    camera_.name = name;
  }

  MarkerCalibration solve() {
    follow();
    Reconstruction shape = best_start();
    views_ = spread_views(kMostPictures);
    shape = carried_over(shape);
    extend(shape);
    shape = adjusted(shape, Lens::pinhole);
    for (int i = 0; i < 2; ++i) {
      join_returned(shape);
      extend(shape);
      shape = adjusted(shape, Lens::pinhole);
    }
    return finished(shape);
  }

 private:
  const Dot& dot_at(const View& view, int dot) const {
    return pictures_[static_cast<std::size_t>(view.picture)].dots[static_cast<std::size_t>(dot)];
  }
  const Vector2d& pixel_of(const View& view, int track) const {
    return dot_at(view, view.dot_of_track.at(track)).centre_px;
  }

  void follow() {
    std::vector<std::vector<Dot>> dots;
    for (const MarkerPicture& picture : pictures_) dots.push_back(picture.dots);
    tracks_ = follow_dots(dots);
    root_.resize(static_cast<std::size_t>(tracks_.count));
    for (int i = 0; i < tracks_.count; ++i) root_[static_cast<std::size_t>(i)] = i;
    views_ = spread_views(kStartPictures);
  }

  /// Views spread evenly over the pictures; dots that returned have their first track.
  std::vector<View> spread_views(int most) const {
    const auto count = static_cast<int>(pictures_.size());
    const int taken = std::min(most, count);
    std::vector<View> views;
    for (int k = 0; k < taken; ++k) {
      View view;
      view.picture = taken > 1 ? k * (count - 1) / (taken - 1) : 0;
      const auto& of_dot = tracks_.track_of_dot[static_cast<std::size_t>(view.picture)];
      for (std::size_t j = 0; j < of_dot.size(); ++j) {
        const int track = root_[static_cast<std::size_t>(of_dot[j])];
        view.dot_of_track.try_emplace(track, static_cast<int>(j));
      }
      views.push_back(std::move(view));
    }
    return views;
  }

  std::vector<int> common_tracks(const View& a, const View& b) const {
    std::vector<int> result;
    for (const auto& [track, dot] : a.dot_of_track) {
      if (b.dot_of_track.count(track) != 0) result.push_back(track);
    }
    return result;
  }

  /// How far the dots of two views move against each other, px: what is left of their motion when
  /// the best affine map is taken out, which only their depth can cause.
  double parallax_px(const View& a, const View& b, const std::vector<int>& tracks) const {
    Eigen::MatrixX3d from(tracks.size(), 3);
    Eigen::MatrixX2d to(tracks.size(), 2);
    for (std::size_t k = 0; k < tracks.size(); ++k) {
      const auto row = static_cast<Eigen::Index>(k);
      from.row(row) = pixel_of(a, tracks[k]).homogeneous().transpose();
      to.row(row) = pixel_of(b, tracks[k]).transpose();
    }
    const Eigen::MatrixX2d left = to - from * from.colPivHouseholderQr().solve(to);
    return std::sqrt(left.squaredNorm() / static_cast<double>(tracks.size()));
  }

  struct Pair {
    int a, b;
    double score;
  };
  /// Pairs of views with many common dots and much parallax, the best first.
  std::vector<Pair> start_pairs() const {
    std::vector<Pair> pairs;
    std::size_t most = 0;
    for (int a = 0; a < static_cast<int>(views_.size()); ++a) {
      for (int b = a + 1; b < static_cast<int>(views_.size()); ++b) {
        const View &first = views_[static_cast<std::size_t>(a)],
                   &second = views_[static_cast<std::size_t>(b)];
        const std::vector<int> common = common_tracks(first, second);
        most = std::max(most, common.size());
        if (common.size() < kFewestTracks) continue;
        pairs.push_back(
            {a, b,
             parallax_px(first, second, common) * std::sqrt(static_cast<double>(common.size()))});
      }
    }
    if (pairs.empty()) report_lost(most);
    std::stable_sort(pairs.begin(), pairs.end(),
                     [](const Pair& x, const Pair& y) { return x.score > y.score; });
    if (pairs.size() > kMostPairs) pairs.resize(kMostPairs);
    return pairs;
  }

  [[noreturn]] void report_lost(std::size_t most) const {
    std::size_t dots = 0;
    for (const MarkerPicture& picture : pictures_) dots = std::max(dots, picture.dots.size());
    if (dots == 0) {
      throw SolverError(
          "no round dots were found in any picture; dots need 5 px across and a ground that "
          "differs "
          "in lightness or colour");
    }
    if (dots < static_cast<std::size_t>(kFewestTracks)) {
      throw SolverError(
          fmt::format("the pictures show {} dots at most; {} are needed", dots, kFewestTracks));
    }
    throw SolverError(fmt::format(
        "of up to {} dots only {} could be followed from one picture to another that is well "
        "apart; "
        "{} are needed. Give a video, or pictures in order with less motion between them",
        dots, most, kFewestTracks));
  }

  Reconstruction best_start() const {
    const std::vector<Pair> pairs = start_pairs();
    Reconstruction best;
    int most_good = 0;
    std::vector<double> focals = kUsualFocals;
    for (double& focal : focals) focal *= camera_.width;
    if (options_.rough_focal_px) focals = {*options_.rough_focal_px};
    for (const double focal_px : focals) {
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
    for (const View& view : views_) all += static_cast<int>(view.dot_of_track.size());
    constexpr double fewest_share = 0.4;
    if (most_good < fewest_share * all || best.points.size() < kFewestTracks) {
      throw SolverError(
          fmt::format("the dots do not move as one rigid body seen by one camera (at most {} of {} "
                      "sightings fit "
                      "within a pixel): is the object rigid, does it turn, and is the zoom fixed?",
                      most_good, all));
    }
    return best;
  }

  static cv::Point2d cv_point(const Vector2d& v) { return {v.x(), v.y()}; }

  Vector2d direction(const Camera& camera, const View& view, int track) const {
    return unproject(camera, pixel_of(view, track)).head<2>();
  }

  bool start_from_pair(const Camera& camera, const Pair& pair, Reconstruction& shape) const {
    const View &a = views_[static_cast<std::size_t>(pair.a)],
               &b = views_[static_cast<std::size_t>(pair.b)];
    std::vector<cv::Point2d> from, to;
    for (const int track : common_tracks(a, b)) {
      from.push_back(cv_point(direction(camera, a, track)));
      to.push_back(cv_point(direction(camera, b, track)));
    }
    cv::Mat mask, turn, shift;
    constexpr double confidence = 0.999;
    const cv::Mat essential =
        cv::findEssentialMat(from, to, cv::Mat::eye(3, 3, CV_64F), cv::RANSAC, confidence,
                             kRansac_px / camera.focal_px.x(), mask);
    if (essential.rows != 3 || essential.cols != 3) return false;
    const int front =
        cv::recoverPose(essential, from, to, cv::Mat::eye(3, 3, CV_64F), turn, shift, mask);
    if (front < kFewestTracks - 1) return false;
    Matrix3d rotation;
    Vector3d translation;
    cv::cv2eigen(turn, rotation);
    cv::cv2eigen(shift, translation);
    shape.camera = camera;
    shape.camera_from_object[pair.a] = {};
    shape.camera_from_object[pair.b] = {Eigen::Quaterniond(rotation), translation};
    triangulate(shape);
    return shape.points.size() >= kFewestTracks - 1;
  }

  /// The place of a dot from all views that have a pose, where their rays differ enough.
  std::optional<Vector3d> place_of(const Reconstruction& shape, int track) const {
    std::vector<Vector3d> centres, rays;
    for (const auto& [index, pose] : shape.camera_from_object) {
      const View& view = views_[static_cast<std::size_t>(index)];
      if (view.dot_of_track.count(track) == 0) continue;
      const Rigid3 object_from_camera = pose.inverse();
      centres.push_back(object_from_camera.translation_m);
      rays.push_back((object_from_camera.rotation * unproject(shape.camera, pixel_of(view, track)))
                         .normalized());
    }
    if (rays.size() < 2) return std::nullopt;
    double widest = 1.0;
    for (const Vector3d& a : rays) {
      for (const Vector3d& b : rays) widest = std::min(widest, a.dot(b));
    }
    if (widest > std::cos(kLeastAngle)) return std::nullopt;
    // Closest to all rays; weights by the inverse square of the distance make errors angles.
    std::vector<double> weights(rays.size(), 1.0);
    Vector3d point = Vector3d::Zero();
    for (int round = 0; round < 2; ++round) {
      Matrix3d normal = Matrix3d::Zero();
      Vector3d right = Vector3d::Zero();
      for (std::size_t i = 0; i < rays.size(); ++i) {
        const Matrix3d across = weights[i] * (Matrix3d::Identity() - rays[i] * rays[i].transpose());
        normal += across;
        right += across * centres[i];
      }
      point = normal.ldlt().solve(right);
      for (std::size_t i = 0; i < rays.size(); ++i) {
        weights[i] = 1.0 / std::max((point - centres[i]).squaredNorm(), 1e-12);
      }
    }
    for (std::size_t i = 0; i < rays.size(); ++i) {
      if (!((point - centres[i]).dot(rays[i]) > 0.0)) return std::nullopt;
    }
    return point;
  }

  double error_px(const Reconstruction& shape, int index, int track, const Vector3d& point) const {
    const Vector3d seen = shape.camera_from_object.at(index) * point;
    if (!(seen.z() > 0.0)) return std::numeric_limits<double>::infinity();
    return (project(shape.camera, seen) - pixel_of(views_[static_cast<std::size_t>(index)], track))
        .norm();
  }

  void triangulate(Reconstruction& shape) const {
    std::set<int> seen;
    for (const auto& [index, pose] : shape.camera_from_object) {
      for (const auto& [track, dot] : views_[static_cast<std::size_t>(index)].dot_of_track) {
        if (shape.points.count(track) == 0) seen.insert(track);
      }
    }
    for (const int track : seen) {
      const auto point = place_of(shape, track);
      if (!point) continue;
      std::vector<double> errors;
      for (const auto& [index, pose] : shape.camera_from_object) {
        if (views_[static_cast<std::size_t>(index)].dot_of_track.count(track) == 0) continue;
        errors.push_back(error_px(shape, index, track, *point));
      }
      std::sort(errors.begin(), errors.end());
      if (errors[errors.size() / 2] < kPose_px) shape.points[track] = *point;
    }
  }

  std::optional<Rigid3> pose_of(const Reconstruction& shape, const View& view) const {
    constexpr int fewest = 6, rounds = 200;
    std::vector<cv::Point3d> points;
    std::vector<cv::Point2d> directions;
    for (const auto& [track, dot] : view.dot_of_track) {
      const auto found = shape.points.find(track);
      if (found == shape.points.end()) continue;
      points.emplace_back(found->second.x(), found->second.y(), found->second.z());
      directions.push_back(cv_point(direction(shape.camera, view, track)));
    }
    if (static_cast<int>(points.size()) < fewest) return std::nullopt;
    cv::Mat turn, shift;
    std::vector<int> inliers;
    const auto reach = static_cast<float>(kPose_px / shape.camera.focal_px.x());
    constexpr double confidence = 0.999;
    const bool found =
        cv::solvePnPRansac(points, directions, cv::Matx33d::eye(), cv::noArray(), turn, shift,
                           false, rounds, reach, confidence, inliers, cv::SOLVEPNP_SQPNP);
    if (!found || 2 * inliers.size() < points.size()) return std::nullopt;
    Vector3d rotation, translation;
    cv::cv2eigen(turn, rotation);
    cv::cv2eigen(shift, translation);
    if (!rotation.allFinite() || !translation.allFinite()) return std::nullopt;
    return Rigid3{quaternion_from_rotation_vector(rotation), translation};
  }

  /// Adds views to the shape, those with most known dots first, and dots to the views.
  void extend(Reconstruction& shape) const {
    std::set<int> failed;
    triangulate(shape);
    while (true) {
      int best = -1, most = 0;
      for (int i = 0; i < static_cast<int>(views_.size()); ++i) {
        if (shape.camera_from_object.count(i) != 0 || failed.count(i) != 0) continue;
        int known = 0;
        for (const auto& [track, dot] : views_[static_cast<std::size_t>(i)].dot_of_track) {
          known += static_cast<int>(shape.points.count(track));
        }
        if (known <= most) continue;
        most = known;
        best = i;
      }
      if (best < 0) return;
      const auto pose = pose_of(shape, views_[static_cast<std::size_t>(best)]);
      if (!pose) {
        failed.insert(best);
        continue;
      }
      shape.camera_from_object[best] = *pose;
      triangulate(shape);
      failed.clear();
    }
  }

  /// The survey of a shape; `tracks`, `views` and `dots` say what its points, placements and
  /// sightings are.
  struct ShapeSurvey {
    Survey survey;
    std::vector<int> tracks, views, dots;
  };
  ShapeSurvey survey_of(const Reconstruction& shape) const {
    ShapeSurvey result;
    result.survey.cameras = {shape.camera};
    std::map<int, int> views_of_track, index_of_track;
    for (const auto& [index, pose] : shape.camera_from_object) {
      for (const auto& [track, dot] : views_[static_cast<std::size_t>(index)].dot_of_track) {
        ++views_of_track[track];
      }
    }
    for (const auto& [track, point] : shape.points) {
      if (views_of_track[track] < kFewestViews) continue;
      index_of_track[track] = static_cast<int>(result.tracks.size());
      result.tracks.push_back(track);
      result.survey.points_m.push_back(point);
    }
    for (const auto& [index, pose] : shape.camera_from_object) {
      const View& view = views_[static_cast<std::size_t>(index)];
      const auto placement = static_cast<int>(result.views.size());
      result.survey.world_from_target.push_back(pose);
      result.views.push_back(index);
      for (const auto& [track, dot] : view.dot_of_track) {
        const auto point = index_of_track.find(track);
        if (point == index_of_track.end()) continue;
        const Sighting sighting{.placement = placement,
                                .point = point->second,
                                .pixel_px = dot_at(view, dot).centre_px,
                                .spread = spread_of(dot_at(view, dot))};
        if (!residual_px(result.survey, sighting).allFinite()) continue;
        result.survey.sightings.push_back(sighting);
        result.dots.push_back(dot);
      }
    }
    return result;
  }

  /// After the joint adjustment; points that few sightings support, and views, are left out.
  Reconstruction adjusted(const Reconstruction& shape, Lens lens) const {
    ShapeSurvey start = survey_of(shape);
    if (start.survey.sightings.size() < kFewestSightings) {
      throw SolverError("too few dots could be placed: the pictures differ too little or too much");
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
      if (support[i] >= kFewestViews) result.points[start.tracks[i]] = found.survey.points_m[i];
    }
    constexpr int fewest = 5;
    for (std::size_t i = 0; i < start.views.size(); ++i) {
      if (kept[i] >= fewest) {
        result.camera_from_object[start.views[i]] = found.survey.world_from_target[i];
      }
    }
    return result;
  }

  int good_sightings(const Reconstruction& shape) const {
    int good = 0;
    for (const auto& [index, pose] : shape.camera_from_object) {
      for (const auto& [track, dot] : views_[static_cast<std::size_t>(index)].dot_of_track) {
        const auto point = shape.points.find(track);
        if (point != shape.points.end() &&
            error_px(shape, index, track, point->second) < kGood_px) {
          ++good;
        }
      }
    }
    return good;
  }

  /// The shape's points and camera; poses are found again for the views as they are now.
  Reconstruction carried_over(const Reconstruction& shape) const {
    Reconstruction result;
    result.camera = shape.camera;
    result.points = shape.points;
    return result;
  }

  /// A dot that comes back has a new track: tracks whose places coincide and that no picture shows
  /// together are one.
  void join_returned(Reconstruction& shape) {
    std::vector<std::set<int>> pictures(static_cast<std::size_t>(tracks_.count));
    for (std::size_t i = 0; i < tracks_.track_of_dot.size(); ++i) {
      for (const int track : tracks_.track_of_dot[i]) {
        pictures[static_cast<std::size_t>(root_[static_cast<std::size_t>(track)])].insert(
            static_cast<int>(i));
      }
    }
    for (auto a = shape.points.begin(); a != shape.points.end(); ++a) {
      for (auto b = std::next(a); b != shape.points.end();) {
        auto &of_a = pictures[static_cast<std::size_t>(a->first)],
             &of_b = pictures[static_cast<std::size_t>(b->first)];
        const bool together = std::any_of(of_b.begin(), of_b.end(),
                                          [&](int picture) { return of_a.count(picture) != 0; });
        if (together || (a->second - b->second).norm() > dot_radius(shape, a->first)) {
          ++b;
          continue;
        }
        for (int& root : root_) {
          if (root == b->first) root = a->first;
        }
        of_a.insert(of_b.begin(), of_b.end());
        b = shape.points.erase(b);
      }
    }
    views_ = spread_views(kMostPictures);
  }

  /// The largest radius that a view says.
  double dot_radius(const Reconstruction& shape, int track) const {
    double radius = 0.0;
    for (const auto& [index, pose] : shape.camera_from_object) {
      const View& view = views_[static_cast<std::size_t>(index)];
      const auto found = view.dot_of_track.find(track);
      if (found == view.dot_of_track.end()) continue;
      const double distance = (pose * shape.points.at(track)).z();
      radius = std::max(
          radius, dot_at(view, found->second).major_px * distance / shape.camera.focal_px.x());
    }
    return radius;
  }

  MarkerCalibration finished(const Reconstruction& shape) {
    ShapeSurvey start = survey_of(shape);
    const std::vector<std::string> names = name_points(start);
    Survey& survey = start.survey;
    survey.cameras[0].lens = options_.lens;
    AdjustmentOptions options;
    options.cameras = {{.aspect = options_.aspect, .principal = options_.principal, .pose = false}};
    options.points = true;
    options.kept_placement = 0;
    options.lengths = {scale_to(names, survey)};
    options.max_iterations = 300;
    if (options_.keep_outliers) options.outlier_sigmas.reset();
    options.cancelled = options_.cancelled;
    std::vector<Vector2d> measured_px;
    std::vector<const Dot*> dots;
    for (std::size_t i = 0; i < survey.sightings.size(); ++i) {
      const int view = start.views[static_cast<std::size_t>(survey.sightings[i].placement)];
      measured_px.push_back(survey.sightings[i].pixel_px);
      dots.push_back(&dot_at(views_[static_cast<std::size_t>(view)], start.dots[i]));
    }
    MarkerCalibration result;
    std::vector<std::optional<DotFace>> faces;
    for (int i = 0; i <= kCorrections; ++i) {
      result.adjustment = adjust(survey, options);
      survey = result.adjustment.survey;
      faces = faces_from_views(result.adjustment, dots);
      if (i < kCorrections) correct_for_perspective(survey, measured_px, faces);
    }
    for (std::size_t i = 0; i < survey.sightings.size(); ++i) {
      const int view = start.views[static_cast<std::size_t>(survey.sightings[i].placement)];
      result.picture_of_sighting.push_back(views_[static_cast<std::size_t>(view)].picture);
      result.dot_of_sighting.push_back(start.dots[i]);
    }
    add_points(names, faces, result);
    note_unused(start, result);
    return result;
  }

  /// In the order of first sight, from the top down.
  std::vector<std::string> name_points(const ShapeSurvey& start) const {
    std::vector<std::string> names;
    // Tracks are numbered in that order.
    const std::size_t digits = std::max<std::size_t>(2, std::to_string(start.tracks.size()).size());
    for (std::size_t i = 0; i < start.tracks.size(); ++i) {
      names.push_back(fmt::format("d{:0{}}", i + 1, digits));
    }
    return names;
  }

  /// Scales the survey; the known length of the adjustment, or one that is kept as it is.
  KnownLength scale_to(const std::vector<std::string>& names, Survey& survey) const {
    KnownLength known{0, 0, 0.0, 0.0};
    if (options_.length) {
      const auto index = [&](const std::string& name) {
        const auto found = std::find(names.begin(), names.end(), name);
        if (found == names.end()) {
          throw InvalidInput(fmt::format(
              "--length: there is no dot '{}'; dots are named {} to {}, as the report's pictures "
              "show",
              name, names.front(), names.back()));
        }
        return static_cast<int>(found - names.begin());
      };
      known.point_a = index(options_.length->a);
      known.point_b = index(options_.length->b);
      known.length_m = options_.length->length_m;
      const double now = (survey.points_m[static_cast<std::size_t>(known.point_a)] -
                          survey.points_m[static_cast<std::size_t>(known.point_b)])
                             .norm();
      const double factor = known.length_m / now;
      for (Vector3d& point : survey.points_m) point *= factor;
      for (Rigid3& pose : survey.world_from_target) pose.translation_m *= factor;
    } else {
      for (std::size_t i = 1; i < survey.points_m.size(); ++i) {
        const double length_m = (survey.points_m[i] - survey.points_m[0]).norm();
        if (length_m > known.length_m) known = {0, static_cast<int>(i), length_m, 0.0};
      }
    }
    known.sigma_m = 1e-4 * known.length_m;
    return known;
  }

  static void add_points(const std::vector<std::string>& names,
                         const std::vector<std::optional<DotFace>>& faces,
                         MarkerCalibration& result) {
    for (std::size_t k = 0; k < names.size(); ++k) {
      MarkerPoint point{.name = names[k], .position_m = result.adjustment.survey.points_m[k]};
      if (faces[k]) {
        point.normal = faces[k]->normal;
        point.radius_m = faces[k]->radius_m;
      }
      if (result.adjustment.covariance) {
        point.sigma_m =
            result.adjustment.covariance->points[k].diagonal().cwiseMax(0.0).cwiseSqrt();
      }
      result.points.push_back(std::move(point));
    }
  }

  void note_unused(const ShapeSurvey& start, MarkerCalibration& result) const {
    const std::size_t unused = views_.size() - start.views.size();
    if (unused > 0) {
      result.notes.push_back(
          fmt::format("{} of {} pictures that were looked at could not be placed by their dots",
                      unused, views_.size()));
    }
  }

  const std::vector<MarkerPicture>& pictures_;
  const MarkerOptions& options_;
  Camera camera_;
  DotTracks tracks_;
  std::vector<int> root_;  // of each track, the first of the same dot
  std::vector<View> views_;
};

}  // namespace

MarkerCalibration calibrate_unknown_markers(const std::vector<MarkerPicture>& pictures,
                                            const std::string& camera_name,
                                            const MarkerOptions& options) {
  for (const MarkerPicture& picture : pictures) {
    if (picture.camera == 0) continue;
    throw InvalidInput(
        "dots at unknown places are for one camera: calibrate one first, and give its points to "
        "all "
        "cameras with --points");
  }
  check_sizes(pictures, {camera_name});
  constexpr std::size_t fewest = 3;
  if (pictures.size() < fewest) {
    throw InvalidInput(fmt::format(
        "{} pictures; dots at unknown places need {} at least, better a video in which the object "
        "turns",
        pictures.size(), fewest));
  }
  return UnknownSolver(pictures, camera_name, options).solve();
}

}  // namespace semblance
