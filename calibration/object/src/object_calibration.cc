#include "semblance/object/object_calibration.h"

#include <fmt/format.h>

#include <chrono>
#include <cmath>

#include "object_refinement.h"
#include "object_start.h"
#include "semblance/core/errors.h"

namespace semblance {
namespace {

using Clock = std::chrono::steady_clock;
using Eigen::MatrixXd;
using Eigen::Vector3d;

constexpr std::size_t kLeastPairs = 4, kFocalPairs = 6;
constexpr double kDoubtfulFocal = 0.25;  // share of the focal length that its deviation may be
constexpr double kFarOff_sigmas = 4.0;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

void check_picture(const ObjectPicture& picture, const ObjectPicture& first) {
  const Image& image = picture.linear;
  if (image.width != first.linear.width || image.height != first.linear.height) {
    throw InvalidInput(fmt::format(
        "{} has {} x {} pixels, but {} has {} x {}: pictures of one camera must be of one size and "
        "upright alike",
        picture.name, image.width, image.height, first.name, first.linear.width,
        first.linear.height));
  }
  const Image& mask = picture.mask;
  if (!mask.empty() && (mask.width != image.width || mask.height != image.height)) {
    throw InvalidInput(fmt::format("the mask of {} has {} x {} pixels, the picture {} x {}",
                                   picture.name, mask.width, mask.height, image.width,
                                   image.height));
  }
  if (picture.pairs.size() < kLeastPairs) {
    throw InvalidInput(
        fmt::format("{}: a pose needs {} pairs of a point and its pixel ({} where the focal length "
                    "is not known), there are {}",
                    picture.name, kLeastPairs, kFocalPairs, picture.pairs.size()));
  }
}

void check(const std::vector<ObjectPicture>& pictures, const ObjectOptions& options) {
  if (pictures.empty()) throw InvalidInput("there is no picture of the object");
  for (const ObjectPicture& picture : pictures) check_picture(picture, pictures.front());
  const Image& image = pictures.front().linear;
  if (options.camera &&
      (options.camera->width != image.width || options.camera->height != image.height)) {
    throw InvalidInput(fmt::format("camera '{}' takes pictures of {} x {} pixels, {} has {} x {}",
                                   options.camera->name, options.camera->width,
                                   options.camera->height, pictures.front().name, image.width,
                                   image.height));
  }
}

Camera first_camera(const std::vector<ObjectPicture>& pictures, const ObjectOptions& options) {
  if (options.camera) {
    Camera camera = *options.camera;
    camera.camera_from_world = {};
    return camera;
  }
  const Image& image = pictures.front().linear;
  Camera camera =
      Camera::centred(image.width, image.height, usual_focal_px(image.width, image.height));
  camera.camera_from_world = {};
  return camera;
}

/// camera_from_object and camera_from_middle differ by where the object's origin is.
Rigid3 middle_pose(const Rigid3& camera_from_object, const Vector3d& centre_m) {
  return {camera_from_object.rotation, camera_from_object * centre_m};
}

/// The object's pose from that of its middle, with its covariance.
ObjectPose object_pose(const Rigid3& camera_from_middle, const Vector3d& centre_m,
                       const MatrixXd& covariance) {
  ObjectPose out;
  const Vector3d arm = camera_from_middle.rotation * centre_m;
  out.camera_from_object = {camera_from_middle.rotation, camera_from_middle.translation_m - arm};
  // A rotation by d moves the origin by -d x arm more than the middle.
  Eigen::Matrix<double, 6, 6> change = Eigen::Matrix<double, 6, 6>::Identity();
  change.bottomLeftCorner<3, 3>() << 0.0, -arm.z(), arm.y(), arm.z(), 0.0, -arm.x(), -arm.y(),
      arm.x(), 0.0;
  out.covariance = change * covariance * change.transpose();
  return out;
}

double pairs_rms_px(const Camera& camera, const std::vector<ObjectPose>& poses,
                    const std::vector<ObjectPicture>& pictures) {
  double sum = 0.0;
  std::size_t count = 0;
  for (std::size_t k = 0; k < pictures.size(); ++k) {
    for (const ObjectPair& pair : pictures[k].pairs) {
      sum += (project(camera, poses[k].camera_from_object * pair.point_m) - pair.pixel_px)
                 .squaredNorm();
      ++count;
    }
  }
  return std::sqrt(sum / static_cast<double>(count));
}

/// Joins state and covariance (of the free intrinsics, then the poses).
ObjectEstimate estimate_of(const RefinementState& state, const IntrinsicsFreedom& freedom,
                           const MatrixXd& covariance, const ObjectTarget& target,
                           const std::vector<ObjectPicture>& pictures, double pair_sigma_px) {
  ObjectEstimate out;
  out.camera = state.camera;
  out.focal_free = freedom.focal;
  out.pair_sigma_px = pair_sigma_px;
  out.intrinsics_sigma = Eigen::VectorXd::Zero(4 + coefficient_count(state.camera.lens));
  Eigen::Index i = 0;
  const auto sigma = [&] {
    const double variance = covariance(i, i);
    ++i;
    return std::sqrt(std::max(variance, 0.0));
  };
  if (freedom.focal) {
    out.intrinsics_sigma[0] = sigma();
    out.intrinsics_sigma[1] =
        out.intrinsics_sigma[0] * state.camera.focal_px.y() / state.camera.focal_px.x();
  }
  if (freedom.principal) {
    for (const int k : {2, 3}) out.intrinsics_sigma[k] = sigma();
  }
  for (int k = 0; freedom.distortion && k < coefficient_count(state.camera.lens); ++k) {
    out.intrinsics_sigma[4 + k] = sigma();
  }
  for (const Rigid3& pose : state.poses) {
    out.poses.push_back(object_pose(pose, target.centre_m, covariance.block<6, 6>(i, i)));
    i += 6;
  }
  out.pairs_rms_px = pairs_rms_px(out.camera, out.poses, pictures);
  return out;
}

/// The estimate from pairs with its covariance; none where the pairs do not tell the focal length.
std::optional<ObjectEstimate> pairs_estimate(const ObjectTarget& target,
                                             const std::vector<ObjectPicture>& pictures,
                                             const ObjectStart& start) {
  const IntrinsicsFreedom freedom{.focal = start.focal_free};
  RefinementState state{start.camera, {}};
  for (const Rigid3& pose : start.camera_from_object) {
    state.poses.push_back(middle_pose(pose, target.centre_m));
  }
  std::vector<PictureTerms> terms;
  for (const ObjectPicture& picture : pictures) {
    PictureTerms term;
    term.pairs = picture.pairs;
    term.pair_sigma_px = start.sigma_px;
    for (ObjectPair& pair : term.pairs) pair.point_m -= target.centre_m;
    terms.push_back(std::move(term));
  }
  const ObjectWorkspace workspace(target, pictures.size());
  const ObjectObjective objective(workspace, state.camera, freedom, std::move(terms), state.poses);
  const auto covariance = inverse_of_normal(objective.pairs_information(objective.start()));
  if (!covariance) return std::nullopt;
  if (freedom.focal &&
      std::sqrt((*covariance)(0, 0)) > kDoubtfulFocal * start.camera.focal_px.x()) {
    return std::nullopt;
  }
  return estimate_of(state, freedom, *covariance, target, pictures, start.sigma_px);
}

bool enough_for_focal(const std::vector<ObjectPicture>& pictures) {
  return std::any_of(pictures.begin(), pictures.end(), [](const ObjectPicture& picture) {
    return picture.pairs.size() >= kFocalPairs;
  });
}

ObjectEstimate start_estimate(const ObjectTarget& target,
                              const std::vector<ObjectPicture>& pictures, const Camera& camera,
                              const ObjectOptions& options, std::vector<std::string>& notes) {
  if (!options.camera && enough_for_focal(pictures)) {
    const auto found = pairs_estimate(
        target, pictures, start_from_pairs(pictures, camera, true, options.pair_sigma_px));
    if (found) return *found;
  }
  if (!options.camera) {
    notes.push_back(fmt::format(
        "the pairs alone do not tell the focal length: it was kept at the usual {:.0f} px there",
        camera.focal_px.x()));
  }
  const auto found = pairs_estimate(
      target, pictures, start_from_pairs(pictures, camera, false, options.pair_sigma_px));
  if (found) return *found;
  throw InvalidInput(
      "the pairs leave the pose open: their points lie on a line, or all in one place");
}

ObjectEstimate refined_estimate(const ObjectTarget& target,
                                const std::vector<ObjectPicture>& pictures,
                                const ObjectOptions& options, ObjectCalibration& result) {
  const ObjectEstimate& start = result.from_pairs;
  RefinementState state{start.camera, {}};
  for (const ObjectPose& pose : start.poses) {
    state.poses.push_back(middle_pose(pose.camera_from_object, target.centre_m));
  }
  const bool known = options.camera.has_value();
  if (!known) state.camera.lens = options.lens;
  const IntrinsicsFreedom freedom{
      .focal = !known, .principal = !known && options.principal, .distortion = !known};
  ObjectRefinement refinement(target, pictures, freedom, start.pair_sigma_px, options.cancelled);
  state = refinement.run(state);
  result.fits = refinement.fits();
  result.rounds = refinement.rounds();
  if (!refinement.covariance()) {
    throw SolverError(
        "the pictures leave a parameter open: keep the intrinsics (give the camera), seek less of "
        "them, or add pictures from other sides");
  }
  return estimate_of(state, freedom, *refinement.covariance(), target, pictures,
                     start.pair_sigma_px);
}

/// How far the pairs of a picture are from where an estimate has them.
struct PairsAgreement {
  double squares = 0.0;  // in deviations
  double limit = 0.0;    // that chance hardly exceeds: the mean and four deviations of chi squared
  int far = 0;
};

PairsAgreement agreement(const ObjectPicture& picture, const ObjectEstimate& estimate,
                         const ObjectPose& pose, double sigma_px) {
  PairsAgreement out;
  for (const ObjectPair& pair : picture.pairs) {
    const Vector3d seen = pose.camera_from_object * pair.point_m;
    const double distance = (project(estimate.camera, seen) - pair.pixel_px).norm() / sigma_px;
    if (!(distance <= kFarOff_sigmas)) ++out.far;
    out.squares += distance * distance;
  }
  const double freedom = 2.0 * static_cast<double>(picture.pairs.size());
  out.limit = freedom + 4.0 * std::sqrt(2.0 * freedom);
  return out;
}

/// Pairs that agree among themselves, but not with the refined estimate, tell that it has found
/// something else. Single ones that are far off are counted as outliers.
void check_pairs(const std::vector<ObjectPicture>& pictures, ObjectCalibration& result) {
  for (std::size_t k = 0; k < pictures.size(); ++k) {
    const double sigma_px = result.from_pairs.pair_sigma_px;
    const PairsAgreement before =
        agreement(pictures[k], result.from_pairs, result.from_pairs.poses[k], sigma_px);
    const PairsAgreement after =
        agreement(pictures[k], *result.refined, result.refined->poses[k], sigma_px);
    const auto count = static_cast<int>(pictures[k].pairs.size());
    if (2 * after.far > count || (before.squares < before.limit && after.squares > after.limit)) {
      throw SolverError(
          fmt::format("{}: the comparison led away from the pairs, which are {:.1f} px off (rms) "
                      "now; give more "
                      "pairs or a mask of the object, or keep to the pairs",
                      pictures[k].name, sigma_px * std::sqrt(after.squares / count)));
    }
    result.fits[k].outlier_pairs = after.far;
    if (after.far > 0) {
      result.notes.push_back(fmt::format("{}: {} of {} pairs do not fit the picture",
                                         pictures[k].name, after.far, count));
    }
  }
}

}  // namespace

ObjectCalibration calibrate_object(const ObjectTarget& target,
                                   const std::vector<ObjectPicture>& pictures,
                                   const ObjectOptions& options) {
  check(pictures, options);
  const Clock::time_point begin = Clock::now();
  ObjectCalibration result;
  result.from_pairs =
      start_estimate(target, pictures, first_camera(pictures, options), options, result.notes);
  result.start_s = seconds_since(begin);
  if (options.refine) {
    result.refined = refined_estimate(target, pictures, options, result);
    check_pairs(pictures, result);
    const double focal_px = result.refined->camera.focal_px.x();
    if (result.refined->intrinsics_sigma[0] > kDoubtfulFocal * focal_px) {
      result.notes.push_back(fmt::format(
          "the focal length is hardly known: {:.0f} px with a deviation of {:.0f} px; nearer "
          "pictures, or some from other sides, tell more",
          focal_px, result.refined->intrinsics_sigma[0]));
    }
  }
  result.solve_s = seconds_since(begin);
  return result;
}

}  // namespace semblance
