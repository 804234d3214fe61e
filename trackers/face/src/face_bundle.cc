#include "face_bundle.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "bundle_objective.h"
#include "face_parts.h"

namespace semblance {

namespace {

constexpr double kEyeDistance_m = 0.063, kCoarseEyes_px = 14.0;
constexpr double kFirstSigma = 0.04;
constexpr int kRounds = 2;  // per level: visibility, shading and deviation are renewed in each

/// Coarsest level at which the face of the first keyframe still has features.
int coarsest_level(const Camera& camera, const Keyframe& keyframe) {
  const Eigen::Vector3d place = keyframe.x.segment<3>(4);
  const double depth_m = (camera.camera_from_world * place).z();
  const double eyes_px = camera.focal_px.x() * kEyeDistance_m / std::max(depth_m, 0.05);
  const double level = std::floor(std::log2(std::max(eyes_px / kCoarseEyes_px, 1.0)));
  return std::min(static_cast<int>(level),
                  static_cast<int>(keyframe.observation->levels.size()) - 1);
}

}  // namespace

FaceBundle adjust_bundle(const FaceFitter& fitter, const MorphModel& model, const Camera& camera,
                         const std::vector<Keyframe>& keyframes) {
  const BundleLayout layout(model.parameters(), model.shape().identity_count, keyframes.size());
  const std::vector<float> weight =
      triangle_weights(model.shape(), fitter.topology(), tracking_weight);
  std::vector<Eigen::VectorXd> models;
  for (const Keyframe& keyframe : keyframes) models.push_back(keyframe.x);
  const BundleProblem problem{
      fitter,
      model,
      weight,
      camera,
      fitter.part_light(*keyframes.front().observation, camera, models.front()),
      keyframes,
      layout};

  OptimizerOptions options;
  options.max_iterations = 6;
  options.step_tolerance = 2e-3;
  options.cost_tolerance = 1e-3;
  options.initial_damping = 1e-3;
  const auto optimizer = make_optimizer("lm", options);
  Solution solution;
  solution.x = layout.join(models);
  double sigma = kFirstSigma;
  FaceBundle out;
  for (int level = coarsest_level(camera, keyframes.front()); level >= 0; --level) {
    for (int round = 0; round < kRounds; ++round) {
      sigma = BundleObjective(problem, level, solution.x, sigma).deviation(solution.x);
      const BundleObjective objective(problem, level, solution.x, sigma);
      solution = optimizer->minimize(objective, solution.x, silent_progress());
      out.light = objective.lights(solution.x);
    }
  }
  out.identity = solution.x.head(layout.identity_size);
  const Eigen::VectorXd deviation =
      solution.covariance ? Eigen::VectorXd(solution.covariance->diagonal().cwiseSqrt())
                          : Eigen::VectorXd::Constant(layout.space.tangent_size(),
                                                      std::numeric_limits<double>::quiet_NaN());
  out.identity_sigma = deviation.head(layout.identity_size);
  const std::vector<Eigen::Index> first = layout.tangent(0);
  for (int i = 0; i < 3; ++i) out.rotation_sigma_rad[i] = deviation[first[i]];
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    out.x.push_back(layout.model_vector(solution.x, k));
  }
  return out;
}

}  // namespace semblance
