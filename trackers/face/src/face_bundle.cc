#include "semblance/face/face_bundle.h"

#include <limits>

#include "bundle_objective.h"
#include "face_parts.h"

namespace semblance {

namespace {

constexpr double kCoarseEyes_px = 14.0;  // on the coarsest level the face still has features
constexpr double kFirstSigma = 0.04;
constexpr int kRounds = 2;  // per level: visibility, shading and deviation are renewed in each

}  // namespace

FaceBundle adjust_bundle(const FaceFitter& fitter, const MorphModel& model, const Camera& camera,
                         const std::vector<Keyframe>& keyframes) {
  const BundleLayout layout(model.parameters(), model.shape().identity_count, keyframes.size());
  const std::vector<float> weight = bare_face_weight(model.shape(), fitter.topology());
  const std::vector<ContourEdge> contour =
      contour_edges(fitter.topology(), contour_weight(model.shape()));
  const std::vector<GenericColour> colour = generic_colours(model.shape(), fitter.topology());
  std::vector<Eigen::VectorXd> models;
  for (const Keyframe& keyframe : keyframes) models.push_back(keyframe.x);
  BundleProblem problem{fitter,
                        model,
                        weight,
                        contour,
                        colour,
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
  const int coarsest = level_for(*keyframes.front().observation,
                                 eye_distance_px(camera, models.front()), kCoarseEyes_px);
  for (int level = coarsest; level >= 0; --level) {
    for (int round = 0; round < kRounds; ++round) {
      problem.light = BundleObjective(problem, level, solution.x, sigma).common_light(solution.x);
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
