#include "object_start.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "semblance/cameras/adjustment.h"
#include "semblance/cameras/posit.h"
#include "semblance/core/errors.h"

namespace semblance {
namespace {

constexpr std::array kFocalTrials{0.5, 1.0, 2.0, 4.0};  // of the usual one
constexpr double kPriorResiduals = 6.0;

/// The poses of all pictures before a camera; `failed` gets the picture that has none.
std::optional<Survey> posed(const std::vector<ObjectPicture>& pictures, const Camera& camera,
                            std::size_t& failed) {
  Survey survey;
  survey.cameras = {camera};
  for (std::size_t k = 0; k < pictures.size(); ++k) {
    const std::vector<ObjectPair>& pairs = pictures[k].pairs;
    Eigen::Matrix3Xd points(3, pairs.size());
    Eigen::Matrix2Xd pixels(2, pairs.size());
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      points.col(static_cast<Eigen::Index>(i)) = pairs[i].point_m;
      pixels.col(static_cast<Eigen::Index>(i)) = pairs[i].pixel_px;
      survey.sightings.push_back({.camera = 0,
                                  .placement = static_cast<int>(k),
                                  .point = static_cast<int>(survey.points_m.size()),
                                  .pixel_px = pairs[i].pixel_px});
      survey.points_m.push_back(pairs[i].point_m);
    }
    const auto pose = pose_from_points(camera, points, pixels);
    if (!pose) {
      failed = k;
      return std::nullopt;
    }
    survey.world_from_target.push_back(*pose);
  }
  return survey;
}

std::optional<Adjustment> adjusted(const Survey& survey, bool seek_focal) {
  AdjustmentOptions options;
  CameraFreedom freedom = CameraFreedom::none();
  freedom.focal = seek_focal;
  options.cameras = {freedom};
  options.outlier_sigmas.reset();  // too few to tell; the comparison weighs them down
  options.covariance = false;
  try {
    return adjust(survey, options);
  } catch (const SolverError&) {
    return std::nullopt;  // of several trials
  }
}

}  // namespace

double usual_focal_px(int width, int height) { return 1.2 * std::max(width, height); }

ObjectStart start_from_pairs(const std::vector<ObjectPicture>& pictures, const Camera& camera,
                             bool seek_focal, double prior_sigma_px) {
  std::optional<Adjustment> best;
  std::size_t failed = 0;
  for (const double factor : kFocalTrials) {
    if (!seek_focal && factor != 1.0) continue;
    Camera trial = camera;
    trial.focal_px *= factor;
    const auto survey = posed(pictures, trial, failed);
    if (!survey) continue;
    auto found = adjusted(*survey, seek_focal);
    if (found && (!best || found->rms_all_px < best->rms_all_px)) best = std::move(found);
  }
  if (!best) {
    throw InvalidInput(fmt::format(
        "{}: its {} pairs give no pose; they must not lie on a line, and each must carry the point "
        "of the mesh that it shows",
        pictures[failed].name, pictures[failed].pairs.size()));
  }
  const auto count = static_cast<double>(best->survey.sightings.size());
  const double parameters = 6.0 * static_cast<double>(pictures.size()) + (seek_focal ? 1.0 : 0.0);
  const double free = std::max(2.0 * count - parameters, 0.0);
  const double square = count * best->rms_all_px * best->rms_all_px;
  return {.camera = best->survey.cameras[0],
          .camera_from_object = best->survey.world_from_target,
          .focal_free = seek_focal,
          .rms_px = best->rms_all_px,
          .sigma_px = std::sqrt((kPriorResiduals * prior_sigma_px * prior_sigma_px + square) /
                                (kPriorResiduals + free))};
}

}  // namespace semblance
