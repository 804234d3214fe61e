#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "marker_views.h"
#include "semblance/cameras/dot_tracks.h"
#include "semblance/core/errors.h"
#include "shape_from_views.h"

namespace semblance {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kStartPictures = 12;  // that the start is sought in
constexpr int kMostPictures = 40;   // in the adjustment
constexpr int kCorrections = 2;

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
    look_at(kStartPictures);
    if (finder_->most_shared() < ShapeFromViews::fewest_shared) report_lost();
    Reconstruction shape = finder_->best_start();
    look_at(kMostPictures);
    shape = carried_over(shape);
    extend(shape);
    for (int i = 0; i < 2; ++i) {
      join_returned(shape);
      extend(shape);
    }
    return finished(shape);
  }

 private:
  const Dot& dot_at(int view, int dot) const {
    const auto picture = static_cast<std::size_t>(picture_of_view_[static_cast<std::size_t>(view)]);
    return pictures_[picture].dots[static_cast<std::size_t>(dot)];
  }

  void follow() {
    std::vector<std::vector<Dot>> dots;
    for (const MarkerPicture& picture : pictures_) dots.push_back(picture.dots);
    tracks_ = follow_dots(dots);
    root_.resize(static_cast<std::size_t>(tracks_.count));
    for (int i = 0; i < tracks_.count; ++i) root_[static_cast<std::size_t>(i)] = i;
  }

  /// Takes views spread evenly over the pictures; dots that returned have their first track.
  void look_at(int most) {
    const auto count = static_cast<int>(pictures_.size());
    const int taken = std::min(most, count);
    picture_of_view_.clear();
    std::vector<TrackView> views;
    for (int k = 0; k < taken; ++k) {
      const int index = taken > 1 ? k * (count - 1) / (taken - 1) : 0;
      const auto& of_dot = tracks_.track_of_dot[static_cast<std::size_t>(index)];
      const auto& dots = pictures_[static_cast<std::size_t>(index)].dots;
      TrackView view;
      for (std::size_t j = 0; j < of_dot.size(); ++j) {
        const int track = root_[static_cast<std::size_t>(of_dot[j])];
        view.try_emplace(track,
                         TrackedPoint{dots[j].centre_px, spread_of(dots[j]), static_cast<int>(j)});
      }
      picture_of_view_.push_back(index);
      views.push_back(std::move(view));
    }
    ShapeOptions options;
    options.focals_px = kUsualFocals;
    for (double& focal : options.focals_px) focal *= camera_.width;
    if (options_.rough_focal_px) options.focals_px = {*options_.rough_focal_px};
    options.cancelled = options_.cancelled;
    finder_.emplace(camera_, std::move(views), std::move(options));
  }

  void extend(Reconstruction& shape) const {
    finder_->extend(shape);
    shape = finder_->adjusted(shape, Lens::pinhole);
  }

  [[noreturn]] void report_lost() const {
    std::size_t dots = 0;
    for (const MarkerPicture& picture : pictures_) dots = std::max(dots, picture.dots.size());
    if (dots == 0) {
      throw SolverError(
          "no round dots were found in any picture; dots need 5 px across and a ground that "
          "differs "
          "in lightness or colour");
    }
    if (dots < ShapeFromViews::fewest_shared) {
      throw SolverError(fmt::format("the pictures show {} dots at most; {} are needed", dots,
                                    ShapeFromViews::fewest_shared));
    }
    throw SolverError(fmt::format(
        "of up to {} dots only {} could be followed from one picture to another that is well "
        "apart; "
        "{} are needed. Give a video, or pictures in order with less motion between them",
        dots, finder_->most_shared(), ShapeFromViews::fewest_shared));
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
    look_at(kMostPictures);
  }

  /// The largest radius that a view says.
  double dot_radius(const Reconstruction& shape, int track) const {
    double radius = 0.0;
    for (const auto& [index, pose] : shape.camera_from_object) {
      const TrackView& view = finder_->views()[static_cast<std::size_t>(index)];
      const auto found = view.find(track);
      if (found == view.end()) continue;
      const double distance = (pose * shape.points.at(track)).z();
      radius = std::max(radius, dot_at(index, found->second.index).major_px * distance /
                                    shape.camera.focal_px.x());
    }
    return radius;
  }

  MarkerCalibration finished(const Reconstruction& shape) {
    ShapeSurvey start = finder_->survey_of(shape);
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
      dots.push_back(&dot_at(view, start.indices[i]));
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
      result.picture_of_sighting.push_back(picture_of_view_[static_cast<std::size_t>(view)]);
      result.dot_of_sighting.push_back(start.indices[i]);
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
    const std::size_t unused = picture_of_view_.size() - start.views.size();
    if (unused > 0) {
      result.notes.push_back(
          fmt::format("{} of {} pictures that were looked at could not be placed by their dots",
                      unused, picture_of_view_.size()));
    }
  }

  const std::vector<MarkerPicture>& pictures_;
  const MarkerOptions& options_;
  Camera camera_;
  DotTracks tracks_;
  std::vector<int> root_;  // of each track, the first of the same dot
  std::vector<int> picture_of_view_;
  std::optional<ShapeFromViews> finder_;
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
