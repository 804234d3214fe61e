#include "semblance/face/face_fitter.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "face_parts.h"
#include "semblance/core/errors.h"
#include "semblance/core/parallel.h"
#include "semblance/cost/landmark.h"
#include "semblance/cost/light.h"
#include "semblance/cost/photometric.h"
#include "semblance/cost/prior.h"

namespace semblance {

namespace {

constexpr int kTextureSize = 256;
// Deviation of the detector's eye centres, in distances between the eyes (measured on video: 3 %).
constexpr double kEyeDetection = 0.03;
constexpr std::size_t kRefinedStarts = 4;
// Side of a patch whose residuals are alike, in distances between the eyes.
constexpr double kGenericCorrelation = 0.2;
constexpr double kPartEyes_px = 24.0, kPartSigma = 0.1;  // of the comparison without a texture
constexpr double kFaceWidth = 2.2;  // side of the face's picture, in distances between the eyes
constexpr double kRestingExpression = 0.4;  // of the prior's width: first frames are mostly calm

std::vector<int> pose_blocks() { return {0, 1}; }

std::vector<int> all_blocks(const MorphModel& model) {
  std::vector<int> blocks;
  for (std::size_t b = 0; b < model.parameters().blocks().size(); ++b) {
    blocks.push_back(static_cast<int>(b));
  }
  return blocks;
}

/// The declared priors, with expressions held nearer to rest.
PriorCost calm_prior(const ParameterSpace& space, int identity_count) {
  Eigen::VectorXd sigma = space.tangent_prior_sigma();
  const Eigen::Index first_expression = 6 + identity_count;
  if (sigma.size() > first_expression) {
    sigma.tail(sigma.size() - first_expression) *= kRestingExpression;
  }
  return PriorCost(space.initial(), sigma);
}

/// How far the pose may be from where the detector or the marks put it.
PriorCost start_prior(const ParameterSpace& space, const Camera& camera,
                      const Eigen::VectorXd& start) {
  // rad; eye distances; of the depth. The cascade finds frontal faces and the eyes' line tells the
  // roll, but cameras look from above or below.
  constexpr double kPitch = 0.2, kYaw = 0.1, kRoll = 0.08, kPlace = 0.15, kDepth = 0.12;
  const double depth_m = (camera.camera_from_world * Eigen::Vector3d(start.segment<3>(4))).z();
  Eigen::VectorXd sigma =
      Eigen::VectorXd::Constant(space.tangent_size(), std::numeric_limits<double>::infinity());
  sigma.head<3>() << kPitch, kYaw, kRoll;
  sigma.segment<3>(3) << kPlace * kEyeDistance_m, kPlace * kEyeDistance_m, kDepth * depth_m;
  Eigen::VectorXd mean = space.initial();
  mean.head<7>() = start.head<7>();
  return PriorCost(mean, sigma);
}

std::vector<LandmarkTarget> targets_of(const MorphModel& model,
                                       const std::vector<FaceMark>& marks) {
  std::vector<LandmarkTarget> targets;
  for (const FaceMark& mark : marks) {
    const ModelLandmark& landmark = model.landmarks()[static_cast<std::size_t>(mark.landmark)];
    targets.push_back({landmark.triangle, landmark.barycentric, mark.point_px, mark.sigma_px});
  }
  return targets;
}

}  // namespace

void set_pose(const ParameterSpace& space, const Camera& camera, const Eigen::Vector2d& eyes_px,
              double eyes_apart_px, const Eigen::Quaterniond& world_from_model,
              Eigen::VectorXd& x) {
  const double depth_m = camera.focal_px.x() * kEyeDistance_m / eyes_apart_px;
  const Eigen::Vector3d place =
      camera.camera_from_world.inverse() * Eigen::Vector3d(unproject(camera, eyes_px) * depth_m);
  x.segment<4>(space.offset(0)) << world_from_model.w(), world_from_model.vec();
  x.segment<3>(space.offset(1)) = place;
}

FaceFitter::FaceFitter(const MorphModel& model)
    : model_(model),
      topology_(topology_of(model)),
      workspace_(model_, topology_),
      appearance_(*model.shape().mesh, kTextureSize, vertex_albedo(model.shape()),
                  vertex_confidence(model.shape())),
      triangle_weight_(inner_face_weight(model.shape(), topology_)),
      pupil_triangle_(pupil_triangles(model.shape(), topology_)) {}

void FaceFitter::refine(const Observation& observation, const Camera& full_camera,
                        const Stage& stage, const Eigen::VectorXd& start, const FaceBox& detection,
                        const std::vector<FaceMark>& marks, FaceFit& fit) const {
  const ObservationLevel& level = observation.levels[static_cast<std::size_t>(stage.level)];
  const Camera camera = full_camera.scaled(level.scale);
  const std::vector<int> free = stage.with_shape ? all_blocks(model_) : pose_blocks();
  PhotometricOptions photometric;
  photometric.sigma = stage.photometric_sigma;
  photometric.robust_width = 2.0;
  // What a face without texture leaves unexplained is alike over whole cheeks.
  const double patch_px = kGenericCorrelation * eye_distance_px(full_camera, start) * level.scale;
  photometric.correlation_area_px = std::max(4.0, patch_px * patch_px);
  // The same for every start, so that their costs can be compared.
  photometric.reference_pixels = std::pow(kFaceWidth * patch_px / kGenericCorrelation, 2.0);
  std::vector<LandmarkTarget> targets = targets_of(model_, marks);
  for (std::size_t eye = 0; detection.eyes_px && eye < 2; ++eye) {
    if (pupil_triangle_[eye] < 0) continue;
    targets.push_back({pupil_triangle_[eye],
                       {1.0f / 3, 1.0f / 3, 1.0f / 3},
                       (*detection.eyes_px)[eye],
                       kEyeDetection * detection.eye_distance_px()});
  }
  const bool has_targets = !targets.empty();
  const LandmarkCost landmarks(std::move(targets), &topology_, full_camera.width, 20.0);
  OptimizerOptions options;
  options.max_iterations = stage.iterations;
  options.step_tolerance = 3e-3;
  const auto optimizer = make_optimizer("lm", options);
  for (int round = 0; round < stage.rounds; ++round) {
    const SynthesisObjective probe(workspace_, fit.x, free, fit.light, camera, {});
    probe.with_synthesis(probe.restrict_to_free(fit.x), [&](const Synthesis& synthesis) {
      photometric.texture_level = matching_texture_level(synthesis, appearance_, topology_);
      const PhotometricCost cost(&level, &appearance_, &topology_, &triangle_weight_, photometric);
      const std::vector<float> weight = cost.statistics(synthesis).pixel_weight;
      const std::vector<float> flat(synthesis.pixels.size(), 1.0f);
      fit.light =
          estimate_light(synthesis, level, appearance_, topology_, round == 0 ? flat : weight,
                         {.pull = 0.01, .order = 1, .stride = 1});
    });
    const PhotometricCost cost(&level, &appearance_, &topology_, &triangle_weight_, photometric);
    SynthesisObjective shape_of_prior(workspace_, fit.x, free, fit.light, camera, {});
    const PriorCost prior = calm_prior(shape_of_prior.space(), model_.shape().identity_count);
    const PriorCost near_start = start_prior(shape_of_prior.space(), full_camera, start);
    std::vector<const Cost*> costs = {&cost, &prior, &near_start};
    if (has_targets) costs.push_back(&landmarks);
    const SynthesisObjective objective(workspace_, fit.x, free, fit.light, camera, costs);
    const Solution solution =
        optimizer->minimize(objective, objective.restrict_to_free(fit.x), silent_progress());
    fit.x = objective.full(solution.x);
    fit.cost = solution.cost;
    objective.with_synthesis(solution.x, [&](const Synthesis& synthesis) {
      fit.statistics = cost.statistics(synthesis);
    });
  }
}

ShLight FaceFitter::part_light(const Observation& observation, const Camera& full_camera,
                               const Eigen::VectorXd& x) const {
  const int index = level_for(observation, eye_distance_px(full_camera, x), kPartEyes_px);
  const ObservationLevel& level = observation.levels[static_cast<std::size_t>(index)];
  const Camera camera = full_camera.scaled(level.scale);
  ShLight light;
  const std::vector<int> free = all_blocks(model_);
  for (int round = 0; round < 2; ++round) {
    const SynthesisObjective probe(workspace_, x, free, light, camera, {});
    probe.with_synthesis(x, [&](const Synthesis& synthesis) {
      if (synthesis.pixels.size() == 0) return;
      PhotometricOptions photometric;
      photometric.sigma = kPartSigma;
      photometric.robust_width = 2.0;
      photometric.texture_level = matching_texture_level(synthesis, appearance_, topology_);
      const PhotometricCost cost(&level, &appearance_, &topology_, &triangle_weight_, photometric);
      light = estimate_light(synthesis, level, appearance_, topology_,
                             round == 0 ? std::vector<float>(synthesis.pixels.size(), 1.0f)
                                        : cost.statistics(synthesis).pixel_weight,
                             {.pull = 0.01, .order = 1, .stride = 1});
    });
  }
  return light;
}

double FaceFitter::compare_parts(const Observation& observation, const Camera& full_camera,
                                 const Eigen::VectorXd& x, const std::vector<FaceMark>& marks,
                                 NormalEquations* out) const {
  const int index = level_for(observation, eye_distance_px(full_camera, x), kPartEyes_px);
  const ObservationLevel& level = observation.levels[static_cast<std::size_t>(index)];
  const Camera camera = full_camera.scaled(level.scale);
  PhotometricOptions photometric;
  photometric.sigma = kPartSigma;
  photometric.robust_width = 2.0;
  const double patch_px = kGenericCorrelation * eye_distance_px(full_camera, x) * level.scale;
  photometric.correlation_area_px = std::max(4.0, patch_px * patch_px);
  photometric.reference_pixels = std::pow(kFaceWidth * patch_px / kGenericCorrelation, 2.0);
  const std::vector<int> free = all_blocks(model_);
  const ShLight light = part_light(observation, full_camera, x);
  const SynthesisObjective probe(workspace_, x, free, light, camera, {});
  probe.with_synthesis(x, [&](const Synthesis& synthesis) {
    photometric.texture_level = matching_texture_level(synthesis, appearance_, topology_);
  });
  const PhotometricCost cost(&level, &appearance_, &topology_, &triangle_weight_, photometric);
  const LandmarkCost landmarks(targets_of(model_, marks), &topology_, full_camera.width, 20.0);
  std::vector<const Cost*> costs = {&cost};
  if (!marks.empty()) costs.push_back(&landmarks);
  const SynthesisObjective objective(workspace_, x, free, light, camera, costs);
  if (out == nullptr) return objective.evaluate(x);
  return objective.normal_equations(x, *out) ? out->cost : std::numeric_limits<double>::infinity();
}

FaceFit FaceFitter::finish(const Observation& observation, const Camera& camera,
                           const Eigen::VectorXd& detected, const FaceBox& detection,
                           const std::vector<FaceMark>& marks, std::vector<FaceFit> starts,
                           int coarse_level) const {
  parallel_for(starts.size(), [&](std::size_t i) {
    refine(observation, camera, {coarse_level, false, 0.15, 2, 6}, detected, detection, marks,
           starts[i]);
    refine(observation, camera, {coarse_level, true, 0.12, 3, 5}, detected, detection, marks,
           starts[i]);
  });
  const auto best =
      std::min_element(starts.begin(), starts.end(),
                       [](const FaceFit& a, const FaceFit& b) { return a.cost < b.cost; });
  if (best == starts.end() || !best->x.allFinite() || !(best->statistics.correlation > 0.2)) {
    throw SolverError(
        "no face could be fitted to the image: the best start explains nothing of it");
  }
  FaceFit fit = *best;
  for (int level = coarse_level - 1; level >= 0; --level) {
    refine(observation, camera, {level, true, 0.1, 3, 6}, detected, detection, marks, fit);
  }
  return fit;
}

FaceFit FaceFitter::fit(const Observation& observation, const Camera& camera,
                        const FaceBox& box) const {
  const double apart = box.eye_distance_px();
  const Eigen::Vector2d middle = box.eye_middle_px();
  const double tilt = box.eyes_px ? std::atan2((*box.eyes_px)[0].y() - (*box.eyes_px)[1].y(),
                                               (*box.eyes_px)[1].x() - (*box.eyes_px)[0].x())
                                  : 0.0;
  Eigen::VectorXd detected = model_.parameters().initial();
  set_pose(model_.parameters(), camera, middle, apart,
           Eigen::Quaterniond(Eigen::AngleAxisd(tilt, Eigen::Vector3d::UnitZ())), detected);
  const int level_index = level_for(observation, apart, 16.0);
  const ObservationLevel& level = observation.levels[static_cast<std::size_t>(level_index)];
  const Camera small = camera.scaled(level.scale);
  std::vector<FaceFit> starts;
  for (double yaw : {-0.5, -0.25, 0.0, 0.25, 0.5}) {
    for (double pitch : {-0.2, 0.0, 0.2}) {
      for (double roll : {-0.12, 0.0, 0.12}) {
        for (double scale : {0.9, 1.0, 1.1}) {
          for (double shift : {-0.08, 0.0, 0.08}) {
            FaceFit start;
            start.x = model_.parameters().initial();
            const Eigen::Quaterniond q = Eigen::AngleAxisd(tilt + roll, Eigen::Vector3d::UnitZ()) *
                                         Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY()) *
                                         Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitX());
            set_pose(model_.parameters(), camera, middle + Eigen::Vector2d(0.0, shift * apart),
                     apart * scale, q, start.x);
            starts.push_back(std::move(start));
          }
        }
      }
    }
  }
  parallel_for(starts.size(), [&](std::size_t i) {
    FaceFit& start = starts[i];
    const SynthesisObjective probe(workspace_, start.x, pose_blocks(), start.light, small, {});
    const Eigen::VectorXd pose = probe.restrict_to_free(start.x);
    PhotometricOptions options;
    options.sigma = 0.15;
    options.robust_width = 2.0;
    probe.with_synthesis(pose, [&](const Synthesis& synthesis) {
      if (synthesis.pixels.size() < 64) return;
      options.texture_level = matching_texture_level(synthesis, appearance_, topology_);
      start.light = estimate_light(synthesis, level, appearance_, topology_,
                                   std::vector<float>(synthesis.pixels.size(), 1.0f),
                                   {.pull = 0.01, .order = 1, .stride = 2});
    });
    const SynthesisObjective lit(workspace_, start.x, pose_blocks(), start.light, small, {});
    const PhotometricCost cost(&level, &appearance_, &topology_, &triangle_weight_, options);
    lit.with_synthesis(
        pose, [&](const Synthesis& synthesis) { start.statistics = cost.statistics(synthesis); });
  });
  const std::size_t kept = std::min(kRefinedStarts, starts.size());
  std::partial_sort(starts.begin(), starts.begin() + static_cast<std::ptrdiff_t>(kept),
                    starts.end(), [](const FaceFit& a, const FaceFit& b) {
                      return a.statistics.correlation > b.statistics.correlation;
                    });
  starts.resize(kept);
  return finish(observation, camera, detected, box, {}, std::move(starts), level_index);
}

FaceFit FaceFitter::fit(const Observation& observation, const Camera& camera,
                        const std::vector<FaceMark>& marks) const {
  if (marks.size() < 4) {
    throw InvalidInput("a fit from points needs at least 4 of them, got " +
                       std::to_string(marks.size()));
  }
  // Place the model so that the marks' centre and spread agree, then let the marks alone turn it.
  Scene scene;
  FaceFit start;
  start.x = model_.parameters().initial();
  model_.synthesize(start.x, scene);
  Eigen::Vector2d centre = Eigen::Vector2d::Zero(), model_centre = Eigen::Vector2d::Zero();
  std::vector<Eigen::Vector2d> model_points;
  for (const FaceMark& mark : marks) {
    const ModelLandmark& landmark = model_.landmarks()[static_cast<std::size_t>(mark.landmark)];
    const auto& corner = topology_.triangles[static_cast<std::size_t>(landmark.triangle)];
    Eigen::Vector3f p = Eigen::Vector3f::Zero();
    for (int k = 0; k < 3; ++k) {
      p += landmark.barycentric[k] * scene.objects[0].positions_m.row(corner[k]).transpose();
    }
    model_points.emplace_back(p.x(), -p.y());
    centre += mark.point_px / static_cast<double>(marks.size());
    model_centre += model_points.back() / static_cast<double>(marks.size());
  }
  double spread = 0.0, model_spread = 0.0;
  for (std::size_t i = 0; i < marks.size(); ++i) {
    spread += (marks[i].point_px - centre).squaredNorm();
    model_spread += (model_points[i] - model_centre).squaredNorm();
  }
  if (!(spread > 0.0)) throw InvalidInput("the points all lie in one place");
  const double px_per_m = std::sqrt(spread / model_spread);
  set_pose(model_.parameters(), camera, centre - model_centre * px_per_m, kEyeDistance_m * px_per_m,
           Eigen::Quaterniond::Identity(), start.x);
  const int level = level_for(observation, eye_distance_px(camera, start.x), 16.0);
  return finish(observation, camera, start.x, FaceBox(), marks, {start}, level);
}

}  // namespace semblance
