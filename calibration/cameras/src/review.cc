#include "semblance/cameras/review.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "projection_map.h"
#include "semblance/cameras/judge.h"
#include "semblance/core/errors.h"

namespace semblance {
namespace {

constexpr double kSigmas = 3.0;
constexpr double kVisible_px = 0.3;

RigCalibration fit(const std::vector<RigView>& views, const std::vector<Camera>& cameras, bool keep,
                   const std::function<bool()>& cancelled) {
  std::vector<RigCamera> known;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    RigCamera camera;
    camera.name = cameras[i].name;
    camera.camera = cameras[i];
    camera.keep_intrinsics = keep;
    camera.keep_pose = keep || i == 0;
    known.push_back(std::move(camera));
  }
  RigOptions options;
  options.cancelled = cancelled;
  return calibrate_rig(views, known, options);
}

// Each camera's views alone; none where they are too few for its lens.
std::vector<std::optional<RigCalibration>> fit_alone(const std::vector<RigView>& views,
                                                     const std::vector<Camera>& cameras,
                                                     const std::function<bool()>& cancelled) {
  std::vector<std::optional<RigCalibration>> alone(cameras.size());
  if (cameras.size() == 1) return alone;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    std::vector<RigView> own;
    for (const RigView& view : views) {
      if (view.camera != static_cast<int>(i)) continue;
      own.push_back(view);
      own.back().camera = 0;
    }
    try {
      alone[i] = fit(own, {cameras[i]}, false, cancelled);
    } catch (const InvalidInput&) {  // too few views, or all alike
    } catch (const SolverError&) {
    }
  }
  return alone;
}

void review_lens(const Camera& given, const Camera& refit, const Eigen::MatrixXd& covariance,
                 CameraReview& review) {
  const ProjectionMap map(given, verdict_rows, verdict_columns);
  const Eigen::MatrixXd change = map.change_px(refit);
  const auto known = change.array().isFinite();
  if (!known.any()) return;
  review.worst_change_px = known.select(change, 0.0).maxCoeff();
  review.mean_change_px = std::sqrt(known.select(change, 0.0).array().square().sum() /
                                    static_cast<double>(known.count()));
  review.mean_sigma_px = map.mean_sigma_px(covariance);
}

void review_pose(const Camera& given, const Camera& refit, const CameraUncertainty& known,
                 CameraReview& review) {
  const Rigid3 change = refit.camera_from_world * given.camera_from_world.inverse();
  review.turn_rad = rotation_vector_from_quaternion(change.rotation).norm();
  review.shift_m = (refit.camera_from_world.inverse().translation_m -
                    given.camera_from_world.inverse().translation_m)
                       .norm();
  review.turn_sigma_rad = std::sqrt(known.pose.topLeftCorner<3, 3>().trace());
  review.shift_sigma_m = std::sqrt(centre_covariance(refit, known).trace());
}

void warn(const std::string& name, const Camera& camera, const CameraReview& review,
          bool places_are_told, std::vector<std::string>& warnings) {
  const auto stands_out = [](double change, double sigma) { return change > kSigmas * sigma; };
  if (!review.has_sigma) {
    warnings.push_back(
        fmt::format("{}: these pictures leave the lens open; it was not tested", name));
    return;
  }
  if (review.mean_change_px > kVisible_px &&
      stands_out(review.mean_change_px, review.mean_sigma_px)) {
    warnings.push_back(fmt::format(
        "{}: the lens has changed: its projection differs by {:.2f} px (rms, up to {:.2f}) from "
        "what these pictures show, {:.0f} times the deviation of that; calibrate anew",
        name, review.mean_change_px, review.worst_change_px,
        review.mean_change_px / review.mean_sigma_px));
  }
  if (!places_are_told) return;
  const double turn_px = review.turn_rad * camera.focal_px.x();
  if ((turn_px > kVisible_px && stands_out(review.turn_rad, review.turn_sigma_rad)) ||
      stands_out(review.shift_m, review.shift_sigma_m)) {
    warnings.push_back(fmt::format(
        "{}: the camera has moved against the first one: turned by {:.3f} +- {:.3f} degrees, "
        "shifted by {:.1f} +- {:.1f} mm; calibrate the rig anew",
        name, review.turn_rad * 180.0 / std::numbers::pi,
        review.turn_sigma_rad * 180.0 / std::numbers::pi, 1e3 * review.shift_m,
        1e3 * review.shift_sigma_m));
  }
}

}  // namespace

CalibrationReview review_calibration(const std::vector<RigView>& views,
                                     const std::vector<Camera>& cameras,
                                     const std::function<bool()>& cancelled) {
  CalibrationReview result;
  result.given = fit(views, cameras, true, cancelled);
  result.refit = fit(views, cameras, false, cancelled);
  const auto alone = fit_alone(views, cameras, cancelled);
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    CameraReview& review = result.cameras.emplace_back();
    review.rms_px = result.given.fits[i].rms_px;
    review.refit_rms_px = result.refit.fits[i].rms_px;
    if (alone[i]) result.refit.fits[i].alone_px = alone[i]->fits[0].rms_px;
  }
  const std::string worse = disagreement(result.refit);
  if (!worse.empty()) {
    result.warnings.push_back(fmt::format(
        "{}: the cameras disagree about the sheet's place. Pictures of one number may be of "
        "different times; whether a camera has moved cannot be told from them",
        worse));
  }
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    CameraReview& review = result.cameras[i];
    const bool by_itself = !worse.empty() && alone[i];
    const RigCalibration& refit = by_itself ? *alone[i] : result.refit;
    const std::size_t at = by_itself ? 0 : i;
    review.has_sigma = refit.adjustment.covariance.has_value();
    if (review.has_sigma) {
      const CameraUncertainty& known = refit.adjustment.covariance->cameras[at];
      review_lens(cameras[i], refit.cameras[at], known.intrinsics, review);
      if (i > 0 && worse.empty()) review_pose(cameras[i], refit.cameras[at], known, review);
    }
    warn(cameras[i].name, cameras[i], review, worse.empty(), result.warnings);
  }
  return result;
}

}  // namespace semblance
