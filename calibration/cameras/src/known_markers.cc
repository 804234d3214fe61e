#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "dot_naming.h"
#include "marker_views.h"
#include "semblance/core/errors.h"

namespace semblance {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kFewestPoints = 7;
constexpr std::size_t kEnoughSeeds = 4;  // pictures that the first focal length comes from
constexpr double kFirstReach = 0.02, kLastReach_px = 2.0;  // of the picture's width; at the end
constexpr double kReachSigmas = 5.0;
constexpr int kCorrections = 2;
// Focal lengths in widths of the picture, from wide angle to tele.
const std::vector<double> kRoughFocals{1.0, 0.85, 1.18};

struct NamedPicture {
  int picture = 0;
  Naming naming;
};

using Pictures = std::vector<MarkerPicture>;

/// Names the dots of one camera's pictures, and finds that camera roughly.
class CameraNamer {
 public:
  CameraNamer(const Pictures& pictures, std::vector<int> own, const DotNamer& namer,
              const std::vector<Vector3d>& points_m, const MarkerOptions& options)
      : pictures_(pictures),
        own_(std::move(own)),
        namer_(namer),
        points_m_(points_m),
        options_(options) {
    const MarkerPicture& first = pictures_[static_cast<std::size_t>(own_[0])];
    camera_ =
        Camera::centred(first.width, first.height, options.rough_focal_px.value_or(first.width));
    camera_.camera_from_world = {};
  }

  std::vector<NamedPicture> name(std::vector<std::string>& notes) {
    find_focal();
    std::vector<NamedPicture> result;
    const NamedPicture* before = nullptr;
    for (const int index : own_) {
      const MarkerPicture& picture = pictures_[static_cast<std::size_t>(index)];
      std::optional<Naming> naming;
      if (before != nullptr && picture.follows) naming = follow(before->naming, picture);
      if (!naming) naming = namer_.search(camera_, centres_px(picture.dots), true);
      before = nullptr;
      if (!naming) {
        notes.push_back(fmt::format("{}: its {} dots fit no view of the points; left out",
                                    picture.name, picture.dots.size()));
      } else if (naming->ambiguous) {
        notes.push_back(ambiguity(picture));
      } else {
        result.push_back({index, *naming});
        before = &result.back();
      }
    }
    return result;
  }
  const Camera& camera() const { return camera_; }

 private:
  static std::string ambiguity(const MarkerPicture& picture) {
    return fmt::format(
        "{}: its dots can be named in several ways that fit nearly alike: ambiguous, left out",
        picture.name);
  }

  std::optional<Naming> follow(const Naming& before, const MarkerPicture& picture) const {
    return namer_.near(camera_, before.camera_from_object, centres_px(picture.dots),
                       kFirstReach * camera_.width);
  }

  /// The focal length that suits the first pictures whose dots can be named beyond doubt.
  void find_focal() {
    std::vector<double> factors = options_.rough_focal_px ? kRoughFocals : kUsualFocals;
    std::vector<NamedPicture> seeds;
    std::size_t most_dots = 0, ambiguous = 0;
    for (const int index : evenly_ordered()) {
      if (seeds.size() >= kEnoughSeeds || (options_.cancelled && options_.cancelled())) break;
      const MarkerPicture& picture = pictures_[static_cast<std::size_t>(index)];
      most_dots = std::max(most_dots, picture.dots.size());
      auto naming = namer_.search_focal(camera_, centres_px(picture.dots), factors);
      if (!naming) continue;
      ambiguous += naming->ambiguous;
      if (naming->ambiguous) continue;
      // The first one says roughly what the others are to be tried with.
      if (seeds.empty()) camera_.focal_px = naming->camera.focal_px;
      factors = kRoughFocals;
      seeds.push_back({index, std::move(*naming)});
    }
    if (seeds.empty()) report_failure(most_dots, ambiguous);
    // Of what the seeds say one by one, the middle; together they say it better.
    std::vector<double> focals;
    for (const NamedPicture& seed : seeds) focals.push_back(seed.naming.camera.focal_px.x());
    std::nth_element(focals.begin(),
                     focals.begin() + static_cast<std::ptrdiff_t>(focals.size() / 2), focals.end());
    camera_.focal_px.setConstant(focals[focals.size() / 2]);
    adjust_focal(seeds);
  }

  void adjust_focal(const std::vector<NamedPicture>& seeds) {
    Survey survey;
    survey.cameras = {camera_};
    survey.points_m = points_m_;
    for (const NamedPicture& seed : seeds) {
      const auto placement = static_cast<int>(survey.world_from_target.size());
      // The camera's distance goes with its focal length.
      Rigid3 pose = seed.naming.camera_from_object;
      pose.translation_m.z() *= camera_.focal_px.x() / seed.naming.camera.focal_px.x();
      survey.world_from_target.push_back(pose);
      const auto& dots = pictures_[static_cast<std::size_t>(seed.picture)].dots;
      for (std::size_t j = 0; j < dots.size(); ++j) {
        if (seed.naming.point_of_dot[j] < 0) continue;
        survey.sightings.push_back({0, placement, seed.naming.point_of_dot[j], dots[j].centre_px});
      }
    }
    AdjustmentOptions options;
    options.cameras = {CameraFreedom::none()};
    options.cameras[0].focal = true;
    options.covariance = false;
    const Camera found = adjust(survey, options).survey.cameras[0];
    if (found.focal_px.x() > 0.2 * camera_.width && found.focal_px.x() < 20.0 * camera_.width) {
      camera_ = found;
    }
  }

  /// The first, the last, the middle one, and so on.
  std::vector<int> evenly_ordered() const {
    std::vector<int> result;
    const std::size_t count = own_.size();
    for (std::size_t parts = 1; result.size() < count; parts *= 2) {
      for (std::size_t k = 0; k < parts; ++k) {
        const int index = own_[(2 * k + 1) * count / (2 * parts)];
        if (std::find(result.begin(), result.end(), index) == result.end()) {
          result.push_back(index);
        }
      }
    }
    return result;
  }

  [[noreturn]] void report_failure(std::size_t most_dots, std::size_t ambiguous) const {
    const std::string first = pictures_[static_cast<std::size_t>(own_[0])].name;
    if (most_dots == 0) {
      throw SolverError(fmt::format(
          "{}{}: no round dots were found; dots need 5 px across and a ground that differs in "
          "lightness or colour",
          first, own_.size() > 1 ? " and the others" : ""));
    }
    if (most_dots < static_cast<std::size_t>(kFewestPoints)) {
      throw SolverError(fmt::format(
          "{} and the others show {} dots at most; {} of those in the points' file must be seen in "
          "one picture",
          first, most_dots, kFewestPoints));
    }
    if (ambiguous > 0) {
      throw SolverError(fmt::format(
          "the dots can be named in several ways that fit nearly alike, in {} of {} pictures, and "
          "beyond doubt in none: ambiguous. Show more dots at once, give --focal, or make the "
          "layout less regular",
          ambiguous, own_.size()));
    }
    throw SolverError(fmt::format(
        "no picture of {} shows the points: of up to {} dots found, too few lie where the points' "
        "file says, whatever the view. Is the file of this object, and in metres?",
        first, most_dots));
  }

  const Pictures& pictures_;
  std::vector<int> own_;
  const DotNamer& namer_;
  const std::vector<Vector3d>& points_m_;
  const MarkerOptions& options_;
  Camera camera_;
};

/// camera_from_world of cameras linked through the instants that they share (as in a rig).
using Views = std::map<std::pair<int, int>, Rigid3>;  // by camera and instant: camera_from_object

Rigid3 link_between(const Views& views, int a, int b, double extent_m, int& shared) {
  std::vector<Rigid3> links;
  for (const auto& [key, pose] : views) {
    if (key.first != a) continue;
    const auto other = views.find({b, key.second});
    if (other != views.end()) links.push_back(other->second * pose.inverse());
  }
  shared = static_cast<int>(links.size());
  if (links.empty()) return {};
  // The one that differs least from the others, by the median.
  std::size_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < links.size(); ++i) {
    std::vector<double> distances;
    for (const Rigid3& other : links) {
      const Rigid3 step = other * links[i].inverse();
      distances.push_back(extent_m * rotation_vector_from_quaternion(step.rotation).norm() +
                          (other.translation_m - links[i].translation_m).norm());
    }
    std::nth_element(distances.begin(),
                     distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2),
                     distances.end());
    if (distances[distances.size() / 2] >= least) continue;
    least = distances[distances.size() / 2];
    best = i;
  }
  return links[best];
}

void place_cameras(const Views& views, const std::vector<std::string>& names, double extent_m,
                   std::vector<Camera>& cameras) {
  std::set<int> reached{0};
  while (reached.size() < cameras.size()) {
    int most = 0, from = 0, to = 0;
    Rigid3 link;
    for (const int a : reached) {
      for (int b = 0; b < static_cast<int>(cameras.size()); ++b) {
        int shared = 0;
        if (reached.count(b) != 0) continue;
        const Rigid3 candidate = link_between(views, a, b, extent_m, shared);
        if (shared <= most) continue;
        most = shared;
        from = a;
        to = b;
        link = candidate;
      }
    }
    if (most == 0) {
      const auto missing = std::find_if(names.begin(), names.end(), [&](const std::string& name) {
        return reached.count(static_cast<int>(&name - names.data())) == 0;
      });
      throw InvalidInput(fmt::format(
          "camera '{}' shares no instant with the others in which the dots of both are named: show "
          "the object to it and to another one at the same instant",
          *missing));
    }
    cameras[static_cast<std::size_t>(to)].camera_from_world =
        link * cameras[static_cast<std::size_t>(from)].camera_from_world;
    reached.insert(to);
  }
}

class KnownSolver {
 public:
  KnownSolver(const Pictures& pictures, const std::vector<std::string>& names,
              const std::vector<MarkerPoint>& points, const MarkerOptions& options)
      : pictures_(pictures),
        names_(names),
        options_(options),
        namer_(positions(points), normals(points)) {
    result_.points = points;
    survey_.points_m = positions(points);
  }

  MarkerCalibration solve() {
    name_all();
    adjust_all();
    name_again();
    adjust_all();
    for (int i = 0; i < kCorrections; ++i) {
      survey_ = result_.adjustment.survey;
      correct_for_perspective(survey_, measured_px_, faces());
      adjust_all();
    }
    return std::move(result_);
  }

 private:
  /// As the file says, otherwise as the ellipses do.
  std::vector<std::optional<DotFace>> faces() const {
    std::vector<const Dot*> dots;
    for (std::size_t i = 0; i < result_.picture_of_sighting.size(); ++i) {
      const auto picture = static_cast<std::size_t>(result_.picture_of_sighting[i]);
      dots.push_back(
          &pictures_[picture].dots[static_cast<std::size_t>(result_.dot_of_sighting[i])]);
    }
    std::vector<std::optional<DotFace>> faces = faces_from_views(result_.adjustment, dots);
    for (std::size_t k = 0; k < faces.size(); ++k) {
      const MarkerPoint& point = result_.points[k];
      if (point.normal && point.radius_m) faces[k] = DotFace{*point.normal, *point.radius_m};
    }
    return faces;
  }

  static std::vector<Vector3d> positions(const std::vector<MarkerPoint>& points) {
    std::vector<Vector3d> result;
    for (const MarkerPoint& point : points) result.push_back(point.position_m);
    return result;
  }
  static std::vector<std::optional<Vector3d>> normals(const std::vector<MarkerPoint>& points) {
    std::vector<std::optional<Vector3d>> result;
    for (const MarkerPoint& point : points) result.push_back(point.normal);
    return result;
  }

  void name_all() {
    std::vector<NamedPicture> named;
    for (int c = 0; c < static_cast<int>(names_.size()); ++c) {
      std::vector<int> own;
      for (int i = 0; i < static_cast<int>(pictures_.size()); ++i) {
        if (pictures_[static_cast<std::size_t>(i)].camera == c) own.push_back(i);
      }
      if (own.empty())
        throw InvalidInput(
            fmt::format("camera '{}' has no picture", names_[static_cast<std::size_t>(c)]));
      CameraNamer namer(pictures_, own, namer_, survey_.points_m, options_);
      const std::vector<NamedPicture> found = namer.name(result_.notes);
      named.insert(named.end(), found.begin(), found.end());
      survey_.cameras.push_back(namer.camera());
      survey_.cameras.back().name = names_[static_cast<std::size_t>(c)];
    }
    place(named);
  }

  void place(const std::vector<NamedPicture>& named) {
    Views views;
    for (const NamedPicture& one : named) {
      const MarkerPicture& picture = pictures_[static_cast<std::size_t>(one.picture)];
      views[{picture.camera, picture.instant}] = one.naming.camera_from_object;
    }
    Eigen::AlignedBox3d box;
    for (const Vector3d& point : survey_.points_m) box.extend(point);
    if (names_.size() > 1) {  // the frame of a rig is upright
      survey_.cameras[0].camera_from_world = Camera::centred(1, 1, 1.0).camera_from_world;
    }
    place_cameras(views, names_, box.diagonal().norm(), survey_.cameras);
    for (const auto& [key, pose] : views) {
      if (placement_of_.count(key.second) != 0) continue;
      placement_of_[key.second] = static_cast<int>(survey_.world_from_target.size());
      const Camera& camera = survey_.cameras[static_cast<std::size_t>(key.first)];
      survey_.world_from_target.push_back(camera.camera_from_world.inverse() * pose);
    }
    for (const NamedPicture& one : named) add_sightings(one.picture, one.naming.point_of_dot);
  }

  void add_sightings(int index, const std::vector<int>& point_of_dot) {
    const MarkerPicture& picture = pictures_[static_cast<std::size_t>(index)];
    for (std::size_t j = 0; j < point_of_dot.size(); ++j) {
      if (point_of_dot[j] < 0) continue;
      const Sighting sighting{.camera = picture.camera,
                              .placement = placement_of_.at(picture.instant),
                              .point = point_of_dot[j],
                              .pixel_px = picture.dots[j].centre_px,
                              .spread = spread_of(picture.dots[j])};
      if (!residual_px(survey_, sighting).allFinite()) continue;
      survey_.sightings.push_back(sighting);
      measured_px_.push_back(sighting.pixel_px);
      result_.picture_of_sighting.push_back(index);
      result_.dot_of_sighting.push_back(static_cast<int>(j));
    }
  }

  /// With the cameras known well, a smaller reach names more dots, and none wrongly.
  void name_again() {
    const double reach_px = std::max(kLastReach_px, kReachSigmas * result_.adjustment.sigma_px);
    const std::set<int> used(result_.picture_of_sighting.begin(),
                             result_.picture_of_sighting.end());
    survey_ = result_.adjustment.survey;
    survey_.sightings.clear();
    measured_px_.clear();
    result_.picture_of_sighting.clear();
    result_.dot_of_sighting.clear();
    for (const int index : used) {
      const MarkerPicture& picture = pictures_[static_cast<std::size_t>(index)];
      const Camera& camera = survey_.cameras[static_cast<std::size_t>(picture.camera)];
      const Rigid3 pose =
          camera.camera_from_world *
          survey_.world_from_target[static_cast<std::size_t>(placement_of_.at(picture.instant))];
      add_sightings(index, namer_.assign(camera, pose, centres_px(picture.dots), reach_px));
    }
  }

  void adjust_all() {
    if (survey_.sightings.size() < static_cast<std::size_t>(kFewestPoints)) {
      throw SolverError("too few dots keep their names: do the points' places fit the object?");
    }
    AdjustmentOptions options;
    for (std::size_t c = 0; c < survey_.cameras.size(); ++c) {
      options.cameras.push_back({.aspect = options_.aspect, .principal = options_.principal});
      options.cameras.back().pose = c > 0;
      survey_.cameras[c].lens = options_.lens;
    }
    if (options_.keep_outliers) options.outlier_sigmas.reset();
    options.cancelled = options_.cancelled;
    result_.adjustment = adjust(survey_, options);
  }

  const Pictures& pictures_;
  const std::vector<std::string>& names_;
  const MarkerOptions& options_;
  DotNamer namer_;
  Survey survey_;
  std::map<int, int> placement_of_;  // instant
  std::vector<Vector2d> measured_px_;
  MarkerCalibration result_;
};

}  // namespace

MarkerCalibration calibrate_known_markers(const std::vector<MarkerPicture>& pictures,
                                          const std::vector<std::string>& camera_names,
                                          const std::vector<MarkerPoint>& points,
                                          const MarkerOptions& options) {
  check_sizes(pictures, camera_names);
  if (points.size() < static_cast<std::size_t>(kFewestPoints)) {
    throw InvalidInput(
        fmt::format("{} points are known; {} or more are needed, not all in a plane or regular",
                    points.size(), kFewestPoints));
  }
  std::vector<Vector3d> positions;
  std::vector<std::string> names;
  for (const MarkerPoint& point : points) {
    positions.push_back(point.position_m);
    names.push_back(point.name);
  }
  if (const auto symmetry = symmetry_of(positions, names)) {
    throw InvalidInput(fmt::format(
        "the points are symmetric: {}. No picture tells which is which: ambiguous. Move or add a "
        "dot",
        *symmetry));
  }
  return KnownSolver(pictures, camera_names, points, options).solve();
}

}  // namespace semblance
