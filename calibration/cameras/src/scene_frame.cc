#include "semblance/cameras/scene_frame.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <cmath>

#include "rays.h"
#include "semblance/cameras/adjustment.h"
#include "semblance/core/errors.h"

namespace semblance {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;

Matrix3Xd columns_of(const std::vector<Vector3d>& points) {
  Matrix3Xd result(3, static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) {
    result.col(static_cast<Eigen::Index>(i)) = points[i];
  }
  return result;
}

double rms_of(const Similarity& similarity, const Matrix3Xd& from, const Matrix3Xd& to) {
  double sum = 0.0;
  for (Eigen::Index i = 0; i < from.cols(); ++i) {
    sum += (similarity * from.col(i) - to.col(i)).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(from.cols()));
}

const Vector3d& placed(const Scene& scene, const std::string& name, const char* what) {
  const auto found = scene.points_m.find(name);
  if (found == scene.points_m.end()) {
    throw InvalidInput(fmt::format(
        "the {} '{}' has no place: two photos from different sides must show it", what, name));
  }
  return found->second;
}

// Scale that makes the lengths right, weighted by their deviations.
double scale_from(const Scene& scene, const std::vector<MarksFile::Length>& lengths,
                  SceneFrame& frame) {
  double upper = 0.0, lower = 0.0;
  const auto found = [&](const MarksFile::Length& known) {
    return (placed(scene, known.from, "end of a length") -
            placed(scene, known.to, "end of a length"))
        .norm();
  };
  for (const MarksFile::Length& known : lengths) {
    const double weight = 1.0 / (known.sigma_m * known.sigma_m);
    upper += weight * known.length_m * found(known);
    lower += weight * found(known) * found(known);
  }
  const double scale = upper / lower;
  double sum = 0.0;
  for (const MarksFile::Length& known : lengths) {
    const double error_m = scale * found(known) - known.length_m;
    sum += error_m * error_m;
  }
  frame.rms_m = std::sqrt(sum / static_cast<double>(lengths.size()));
  frame.has_scale = true;
  frame.text = fmt::format("{} known length{}", lengths.size(), lengths.size() == 1 ? "" : "s");
  return scale;
}

Rigid3 motion_to_axes(const Scene& scene, const MarksFile::Axes& axes, double scale) {
  const Vector3d origin = placed(scene, axes.origin, "origin");
  const Vector3d x = (placed(scene, axes.x, "point on the x axis") - origin).normalized();
  const Vector3d towards_y = (placed(scene, axes.y, "point beside the x axis") - origin);
  const Vector3d across = towards_y - towards_y.dot(x) * x;
  if (!(across.norm() > 1e-3 * towards_y.norm())) {
    throw InvalidInput(
        fmt::format("axes: '{}', '{}' and '{}' are on a line; choose a third point beside it",
                    axes.origin, axes.x, axes.y));
  }
  Matrix3d rotation;
  rotation.row(0) = x;
  rotation.row(1) = across.normalized();
  rotation.row(2) = rotation.row(0).cross(rotation.row(1));
  return {Eigen::Quaterniond(rotation), -scale * (rotation * origin)};
}

struct Common {
  std::vector<Vector3d> found, known;
};

Common common_points(const Scene& scene, const std::map<std::string, Vector3d>& known) {
  Common common;
  for (const auto& [name, point] : known) {
    const auto found = scene.points_m.find(name);
    if (found == scene.points_m.end()) continue;
    common.found.push_back(found->second);
    common.known.push_back(point);
  }
  return common;
}

SceneFrame frame_of_known_points(const Common& common, double sigma_m) {
  SceneFrame frame;
  frame.rms_m = rms_of({}, columns_of(common.found), columns_of(common.known));
  frame.has_scale = frame.has_axes = true;
  frame.text = fmt::format(
      "{} known points, {:.3g} mm rms from where they are said to be ({:.3g} "
      "mm a coordinate)",
      common.known.size(), 1e3 * frame.rms_m, 1e3 * sigma_m);
  return frame;
}

}  // namespace

Similarity similarity_between(const Matrix3Xd& from, const Matrix3Xd& to, bool keep_scale) {
  if (from.cols() < 3) throw SolverError("two frames are compared by three points at least");
  const Vector3d middle = from.rowwise().mean();
  const Eigen::JacobiSVD<Matrix3Xd> spread(from.colwise() - middle);
  if (!(spread.singularValues()[1] > 1e-6 * spread.singularValues()[0])) {
    throw SolverError("two frames cannot be compared by points on a line");
  }
  const Eigen::Matrix4d matrix = Eigen::umeyama(from, to, !keep_scale);
  Similarity result;
  result.scale = matrix.topLeftCorner<3, 3>().col(0).norm();
  result.motion = {Eigen::Quaterniond(Matrix3d(matrix.topLeftCorner<3, 3>() / result.scale)),
                   matrix.topRightCorner<3, 1>()};
  return result;
}

Similarity similarity_between(const std::vector<Vector3d>& from, const std::vector<Vector3d>& to,
                              bool keep_scale) {
  return similarity_between(columns_of(from), columns_of(to), keep_scale);
}

Rigid3 moved_pose(const Similarity& new_from_old, const Rigid3& camera_from_old) {
  Rigid3 pose = camera_from_old;
  pose.translation_m *= new_from_old.scale;
  return pose * new_from_old.motion.inverse();
}

void move_scene(Scene& scene, const Similarity& new_from_old) {
  for (auto& [name, point] : scene.points_m) point = new_from_old * point;
  for (Camera& camera : scene.cameras) {
    camera.camera_from_world = moved_pose(new_from_old, camera.camera_from_world);
  }
}

std::map<std::string, Vector3d> place_marks(const std::vector<Camera>& cameras,
                                            const std::vector<MarksFile::Photo>& photos) {
  std::map<std::string, std::vector<Ray>> rays;
  for (std::size_t i = 0; i < photos.size(); ++i) {
    for (const auto& [name, pixel] : photos[i].marks_px) rays[name].push_back({&cameras[i], pixel});
  }
  Survey survey;
  survey.cameras = cameras;
  survey.world_from_target = {Rigid3{}};
  std::vector<std::string> names;
  for (const auto& [name, seen] : rays) {
    const auto start = seen.size() < 2 ? std::nullopt : point_from_rays(seen);
    if (!start) continue;
    for (const Ray& ray : seen) {
      survey.sightings.push_back({static_cast<int>(ray.camera - cameras.data()), 0,
                                  static_cast<int>(names.size()), ray.pixel_px});
    }
    survey.points_m.push_back(*start);
    names.push_back(name);
  }
  if (names.empty()) return {};
  AdjustmentOptions options;
  options.cameras.assign(cameras.size(), CameraFreedom::none());
  options.placements = false;
  options.points = true;
  options.outlier_sigmas.reset();
  options.covariance = false;
  const Adjustment found = adjust(survey, options);
  std::map<std::string, Vector3d> result;
  for (std::size_t i = 0; i < names.size(); ++i) result[names[i]] = found.survey.points_m[i];
  return result;
}

SceneFrame frame_from_marks(const Scene& scene, const MarksFile& marks) {
  if (marks.points_sigma_m) {
    return frame_of_known_points(common_points(scene, marks.points_m), *marks.points_sigma_m);
  }
  SceneFrame frame;
  double& scale = frame.world_from_scene.scale;
  if (!marks.lengths.empty()) scale = scale_from(scene, marks.lengths, frame);
  if (marks.axes) {
    frame.world_from_scene.motion = motion_to_axes(scene, *marks.axes, scale);
    frame.has_axes = true;
    return frame;
  }
  const Common common = common_points(scene, marks.points_m);
  if (common.found.size() < 3) return frame;
  const Matrix3Xd known = columns_of(common.known);
  const Matrix3Xd found = scale * columns_of(common.found);
  const Similarity move = similarity_between(found, known, frame.has_scale);
  frame.rms_m = rms_of(move, found, known);
  frame.text =
      fmt::format("{} known points, {:.3g} mm rms", common.known.size(), 1e3 * frame.rms_m);
  scale *= move.scale;
  frame.world_from_scene.motion = move.motion;
  frame.has_scale = frame.has_axes = true;
  return frame;
}

SceneFrame frame_from_sheet(const Scene& scene, const std::vector<Detection>& detections) {
  std::map<int, std::vector<Ray>> rays;
  const Target* target = nullptr;
  int photos = 0;
  for (std::size_t i = 0; i < detections.size(); ++i) {
    if (!detections[i].found()) continue;
    target = &detections[i].target;
    ++photos;
    for (std::size_t k = 0; k < detections[i].ids.size(); ++k) {
      rays[detections[i].ids[k]].push_back(
          {&scene.cameras[i], detections[i].points_px.col(static_cast<Eigen::Index>(k))});
    }
  }
  std::vector<Vector3d> found, known;
  for (const auto& [id, seen] : rays) {
    const auto point = seen.size() < 2 ? std::nullopt : point_from_rays(seen);
    if (!point) continue;
    found.push_back(*point);
    known.push_back(point_on_sheet(*target, id));
  }
  if (found.size() < 4) {
    throw InvalidInput(
        fmt::format("{} of the photos show the sheet, and place {} of its points; two photos from "
                    "different sides must show four of them",
                    photos, found.size()));
  }
  SceneFrame frame;
  frame.world_from_scene = similarity_between(found, known);
  frame.rms_m = rms_of(frame.world_from_scene, columns_of(found), columns_of(known));
  frame.has_scale = frame.has_axes = true;
  frame.text = fmt::format("the sheet in {} photos, {} points, {:.3g} mm rms", photos, found.size(),
                           1e3 * frame.rms_m);
  return frame;
}

}  // namespace semblance
