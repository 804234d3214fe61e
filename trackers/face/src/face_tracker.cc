#include "semblance/face/face_tracker.h"

#include <algorithm>
#include <cmath>
#include <istream>
#include <limits>
#include <ostream>

#include <Eigen/Cholesky>

#include "face_parts.h"
#include "semblance/core/errors.h"
#include "semblance/core/parallel.h"
#include "semblance/cost/contour.h"
#include "semblance/cost/landmark.h"
#include "semblance/cost/light.h"
#include "semblance/cost/photometric.h"
#include "semblance/cost/prior.h"
#include "semblance/face/face_bundle.h"

namespace semblance {

namespace {

constexpr int kPyramidLevels = 4;
constexpr double kCoarseEyes_px = 14.0;     // distance between the eyes on the coarsest level used
constexpr double kRotationPerFrame = 0.06;  // rad: deviation of the prediction's error
constexpr double kTranslationPerFrame_m = 0.012;
constexpr double kExpressionPerFrame = 0.2, kBlinkPerFrame = 0.6;
constexpr double kVelocityDamping = 0.7;
// Residuals of neighbours are alike over such areas, whatever one frame's lag correlation says.
constexpr double kLeastCorrelationArea_px2 = 25.0, kLargestCorrelationArea_px2 = 400.0;
// A still face fits far better than a turned one: tighter than this, turning would look like being
// covered.
constexpr double kLeastSigma = 0.035, kLargestSigma = 0.08;
// The Gauss-Newton covariance knows noise, not that the model is another person's head: on
// generated clips of an independent model (suite ict-talking) errors of rotation were this many
// times larger.
constexpr double kDiscrepancy = 6.0;
// Without other views of the head: errors of its frame (rad) and of its size that one picture
// leaves.
constexpr double kHeadRotation = 0.05, kHeadSize = 0.06;
constexpr double kGatherCorrelation = 0.8;  // only frames that fit this well add to the texture
constexpr double kGatherTurn = 0.04;        // rad of turning after which new surface may be in view
// Far from the first view poses rest on little of the first texture: what they add would make their
// errors permanent.
constexpr double kLargestGatherTurn = 0.4;
constexpr int kFirstViews =
    8;  // after a first fit, all are gathered: their mean is less noisy than one

// A frame is believed when the synthetic picture resembles the observed one.
constexpr double kLeastCorrelation = 0.72;
constexpr double kLeastInliers = 0.45;
constexpr double kLeastDepth_m = 0.1, kLargestDepth_m = 10.0;
constexpr double kLeastVisible =
    0.4;  // of the pixels the face had at the first fit, scaled by depth

/// What the next frame depends on.
struct State {
  bool initialised = false;
  bool tracking = false;
  Eigen::VectorXd identity, identity_sigma;
  // What is not known of the person's head: an error of rotation and one of distance, relative,
  // that all frames share.
  double head_rotation_sigma = kHeadRotation, head_size_sigma = kHeadSize;
  Eigen::VectorXd x;         // of the person's model: pose and expression
  Eigen::VectorXd velocity;  // of the pose, tangent, per frame
  ShLight light;
  double sigma = 0.04, correlation_area_px = 40.0;
  double views = 0.0;                // gathered so far
  double pixels_at_one_metre = 0.0;  // visible pixels times depth squared at the first fit
  Eigen::Vector4d gathered_at = Eigen::Vector4d::Zero();
  Eigen::Vector4d first_view = Eigen::Vector4d::Zero();  // rotation the texture began with
};

bool is_blink(const std::string& name) {
  return name.find("blink") != std::string::npos || name.find("Blink") != std::string::npos;
}

/// Deviations of the prediction of a frame from the one before, per tangent entry.
Eigen::VectorXd frame_to_frame_sigma(const ParameterSpace& space) {
  Eigen::VectorXd sigma(space.tangent_size());
  sigma.head<3>().setConstant(kRotationPerFrame);
  sigma.segment<3>(3).setConstant(kTranslationPerFrame_m);
  for (std::size_t b = 2; b < space.blocks().size(); ++b) {
    sigma[space.tangent_offset(static_cast<int>(b))] =
        is_blink(space.blocks()[b].name) ? kBlinkPerFrame : kExpressionPerFrame;
  }
  return sigma;
}

void write_vector(std::ostream& out, const double* data, std::uint64_t size) {
  out.write(reinterpret_cast<const char*>(&size), sizeof size);
  out.write(reinterpret_cast<const char*>(data),
            static_cast<std::streamsize>(size * sizeof(double)));
}

void read_vector(std::istream& in, double* data, std::uint64_t expected,
                 const std::string& source) {
  std::uint64_t size = 0;
  in.read(reinterpret_cast<char*>(&size), sizeof size);
  if (!in || size != expected) {
    throw InvalidInput(source + ": saved by another model or version; remove it and start afresh");
  }
  in.read(reinterpret_cast<char*>(data), static_cast<std::streamsize>(size * sizeof(double)));
  if (!in) throw InvalidInput(source + ": ends early; remove it and start afresh");
}

}  // namespace

/// The fixed person: model with identity, its topology and appearance.
struct Person {
  explicit Person(MorphShape shape_in, int texture_size)
      : model(std::move(shape_in)),
        topology(topology_of(model)),
        workspace(model, topology),
        appearance(*model.shape().mesh, texture_size, vertex_albedo(model.shape()),
                   unseen_confidence(model.shape())),
        triangle_weight(triangle_weights(model.shape(), topology, tracking_weight)),
        contour(contour_edges(topology, contour_weight(model.shape()))) {}

  MorphModel model;
  SurfaceTopology topology;
  SynthesisWorkspace workspace;
  Appearance appearance;
  std::vector<float> triangle_weight;
  std::vector<ContourEdge> contour;
};

struct FaceTracker::Impl {
  Impl(MorphShape shape, const Camera& camera_in, const FaceTrackerOptions& options_in)
      : generic(std::move(shape)), fitter(generic), camera(camera_in), options(options_in) {
    OptimizerOptions gradient;
    gradient.max_iterations = 5;
    gradient.step_tolerance = 1e-2;
    gradient.cost_tolerance = 1e-3;
    gradient.seed = options.seed;
    gradient.search_radius = 1.0;
    gradient.max_evaluations = 1500;
    optimizer = make_optimizer(options.optimizer, gradient);
    polish = make_optimizer("lm", gradient);
  }

  struct Attempt {
    Eigen::VectorXd x;
    ShLight light;
    NormalEquations equations;
    PhotometricCost::Statistics statistics;
    bool believed = false;
    std::string reason;
  };

  /// What a level of a frame is compared with.
  struct Comparison {
    PhotometricOptions photometric;
    ShLight light;
    std::vector<ContourTarget> contour;
  };

  bool start(const Observation& observation);
  void make_person(const Eigen::VectorXd& identity);
  std::vector<int> free_blocks() const;
  /// As far as it can be told from the face at x.
  Comparison compare_at(const ObservationLevel& level, const Eigen::VectorXd& x,
                        const ShLight& light, int light_stride) const;
  Attempt fit_frame(const Observation& observation, const Eigen::VectorXd& predicted,
                    double looseness, const Optimizer& method) const;
  /// Lids shut within a frame or two, further than gradients reach: where the fit has them open,
  /// shut is tried, and the other way round.
  void try_lids(const SynthesisObjective& objective, Solution& solution) const;
  Attempt search(const Observation& observation) const;
  void judge(Attempt& attempt) const;
  void gather(const Observation& observation, const Attempt& attempt, bool first);
  TrackFrame report(int frame, double time_s, TrackStatus status, const Attempt& attempt) const;
  /// Pose, parameters, deviations and landmarks of a line.
  void write_estimate(const Eigen::VectorXd& x, const Eigen::Matrix3d& rotation_covariance,
                      const Eigen::VectorXd& tangent_sigma, TrackFrame& out) const;
  double depth(const Eigen::VectorXd& x) const {
    return (camera.camera_from_world * Eigen::Vector3d(x.segment<3>(4))).z();
  }

  MorphModel generic;
  FaceFitter fitter;
  FaceDetector detector;
  Camera camera;
  FaceTrackerOptions options;
  std::unique_ptr<Optimizer> optimizer, polish;
  State state;
  std::unique_ptr<Person> person;
};

void FaceTracker::Impl::make_person(const Eigen::VectorXd& identity) {
  person = std::make_unique<Person>(with_identity(generic.shape(), identity), options.texture_size);
}

bool FaceTracker::Impl::start(const Observation& observation) {
  FaceFit fit;
  if (!options.first_marks.empty()) {
    fit = fitter.fit(observation, camera, options.first_marks);
  } else {
    std::vector<FaceBox> boxes = detector.detect(observation.linear);
    if (boxes.empty()) return false;
    std::sort(boxes.begin(), boxes.end(),
              [](const FaceBox& a, const FaceBox& b) { return a.x_px < b.x_px; });
    if (boxes.size() > 1 && !options.face) {
      throw InvalidInput(std::to_string(boxes.size()) +
                         " faces in the first frame that shows any; choose one with --face N, "
                         "counted from the left and from 0, or mark it with --points");
    }
    const int chosen = options.face.value_or(0);
    if (chosen >= static_cast<int>(boxes.size())) return false;
    try {
      fit = fitter.fit(observation, camera, boxes[static_cast<std::size_t>(chosen)]);
    } catch (const SolverError&) {
      return false;  // the detector saw something that is no face: this frame is lost
    }
  }
  const int identities = generic.shape().identity_count;
  state.identity = fit.x.segment(7, identities);
  state.identity_sigma =
      Eigen::VectorXd::Constant(identities, std::numeric_limits<double>::quiet_NaN());
  make_person(state.identity);
  state.x.resize(person->model.parameters().size());
  state.x << fit.x.head<7>(), fit.x.tail(fit.x.size() - 7 - identities);
  state.velocity = Eigen::VectorXd::Zero(6);
  state.light = fit.light;
  state.initialised = true;
  Attempt first;
  first.x = state.x;
  first.light = fit.light;
  state.first_view = state.x.head<4>();
  gather(observation, first, true);
  return true;
}

std::vector<int> FaceTracker::Impl::free_blocks() const {
  std::vector<int> blocks;
  for (std::size_t b = 0; b < person->model.parameters().blocks().size(); ++b) {
    blocks.push_back(static_cast<int>(b));
  }
  return blocks;
}

FaceTracker::Impl::Comparison FaceTracker::Impl::compare_at(const ObservationLevel& level,
                                                            const Eigen::VectorXd& x,
                                                            const ShLight& light,
                                                            int light_stride) const {
  Comparison out;
  out.light = light;
  out.photometric.sigma = state.sigma;
  out.photometric.correlation_area_px =
      std::max(1.0, state.correlation_area_px * level.scale * level.scale);
  const double eyes_px = eye_distance_px(camera, x) * level.scale;
  const SynthesisObjective probe(person->workspace, x, free_blocks(), light,
                                 camera.scaled(level.scale), {});
  probe.with_synthesis(x, [&](const Synthesis& synthesis) {
    if (synthesis.pixels.size() == 0) return;
    out.photometric.texture_level =
        matching_texture_level(synthesis, person->appearance, person->topology);
    out.photometric.reference_pixels = static_cast<double>(synthesis.pixels.size());
    const PhotometricCost cost(&level, &person->appearance, &person->topology,
                               &person->triangle_weight, out.photometric);
    out.light = estimate_light(synthesis, level, person->appearance, person->topology,
                               cost.statistics(synthesis).pixel_weight,
                               {.pull = 0.05, .order = 2, .stride = light_stride});
    out.contour = find_contour(synthesis, level, person->topology, person->triangle_weight,
                               person->contour, contour_options(eyes_px));
  });
  return out;
}

FaceTracker::Impl::Attempt FaceTracker::Impl::fit_frame(const Observation& observation,
                                                        const Eigen::VectorXd& predicted,
                                                        double looseness,
                                                        const Optimizer& method) const {
  Attempt attempt;
  attempt.x = predicted;
  attempt.light = state.light;
  const std::vector<int> everything = free_blocks();
  const int coarsest = level_for(observation, eye_distance_px(camera, predicted), kCoarseEyes_px);
  // On coarse levels only the pose is solved: the head moves as a whole first, and expression must
  // not explain what is a turn.
  const std::vector<int> pose = {0, 1};
  for (int l = coarsest; l >= 0; --l) {
    const std::vector<int>& free = l > 0 ? pose : everything;
    const ObservationLevel& level = observation.levels[static_cast<std::size_t>(l)];
    const Camera at = camera.scaled(level.scale);
    const Comparison look = compare_at(level, attempt.x, attempt.light, l == 0 ? 3 : 1);
    attempt.light = look.light;
    const PhotometricCost cost(&level, &person->appearance, &person->topology,
                               &person->triangle_weight, look.photometric);
    const ContourCost contour(look.contour, &person->topology);
    const SynthesisObjective probe(person->workspace, attempt.x, free, attempt.light, at, {});
    const Eigen::VectorXd start = probe.restrict_to_free(attempt.x);
    const PriorCost prior(probe.space());
    const Eigen::VectorXd spread = looseness * frame_to_frame_sigma(probe.space());
    const PriorCost temporal(probe.restrict_to_free(predicted), spread);
    SynthesisObjective objective(person->workspace, attempt.x, free, attempt.light, at,
                                 {&cost, &contour, &prior, &temporal});
    objective.set_step_scale(spread);
    Solution solution = method.minimize(objective, start, silent_progress());
    if (l == 0) try_lids(objective, solution);
    attempt.x = objective.full(solution.x);
    if (l > 0) continue;
    objective.normal_equations(solution.x, attempt.equations);
    objective.with_synthesis(solution.x, [&](const Synthesis& synthesis) {
      attempt.statistics = cost.statistics(synthesis);
    });
  }
  judge(attempt);
  return attempt;
}

void FaceTracker::Impl::try_lids(const SynthesisObjective& objective, Solution& solution) const {
  constexpr double kShut = 0.9;
  const ParameterSpace& space = objective.space();
  Eigen::VectorXd x = solution.x;
  for (std::size_t b = 0; b < space.blocks().size(); ++b) {
    if (!is_blink(space.blocks()[b].name)) continue;
    double& lid = x[space.offset(static_cast<int>(b))];
    lid = lid < 0.5 * kShut ? kShut : 0.0;
  }
  if (x == solution.x || !(objective.evaluate(x) < solution.cost)) return;
  Solution other = polish->minimize(objective, x, silent_progress());
  if (other.cost < solution.cost) solution = std::move(other);
}

void FaceTracker::Impl::judge(Attempt& attempt) const {
  const PhotometricCost::Statistics& s = attempt.statistics;
  const double z = depth(attempt.x);
  const double expected = state.pixels_at_one_metre / (z * z);
  attempt.believed = false;
  if (!attempt.x.allFinite() || !std::isfinite(attempt.equations.cost)) {
    attempt.reason = "the solver gave no finite answer";
  } else if (!(z > kLeastDepth_m && z < kLargestDepth_m)) {
    attempt.reason = "implausible distance";
  } else if (s.correlation < kLeastCorrelation) {
    attempt.reason = "the picture does not resemble the face";
  } else if (s.inlier_fraction < kLeastInliers) {
    attempt.reason = "too many pixels do not fit";
  } else if (expected > 0.0 && static_cast<double>(s.pixels) < kLeastVisible * expected) {
    attempt.reason = "too little of the face is in the picture";
  } else {
    attempt.believed = true;
  }
}

FaceTracker::Impl::Attempt FaceTracker::Impl::search(const Observation& observation) const {
  // The last pose first: most losses are short.
  Attempt best = fit_frame(observation, state.x, 3.0, *polish);
  if (best.believed) return best;
  const std::vector<FaceBox> boxes = detector.detect(observation.linear);
  std::vector<Eigen::VectorXd> starts;
  for (const FaceBox& box : boxes) {
    for (double yaw : {0.0, -0.3, 0.3}) {
      for (double scale : {0.9, 1.1}) {
        Eigen::VectorXd x = person->model.parameters().initial();
        set_pose(person->model.parameters(), camera, box.eye_middle_px(),
                 box.eye_distance_px() * scale,
                 Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY())), x);
        starts.push_back(std::move(x));
      }
    }
  }
  std::vector<Attempt> attempts(starts.size());
  parallel_for(starts.size(), [&](std::size_t i) {
    attempts[i] = fit_frame(observation, starts[i], 4.0, *polish);
  });
  for (Attempt& attempt : attempts) {
    if (attempt.believed &&
        (!best.believed || attempt.statistics.correlation > best.statistics.correlation)) {
      best = std::move(attempt);
    }
  }
  return best;
}

void FaceTracker::Impl::gather(const Observation& observation, const Attempt& attempt, bool first) {
  const SynthesisObjective probe(person->workspace, attempt.x, free_blocks(), attempt.light, camera,
                                 {});
  probe.with_synthesis(probe.restrict_to_free(attempt.x), [&](const Synthesis& synthesis) {
    const std::vector<float> flat(synthesis.pixels.size(), 1.0f);
    person->appearance.gather(observation.linear, synthesis.scene.objects[0], camera, attempt.light,
                              synthesis.pixels, first ? flat : attempt.statistics.pixel_weight);
    if (state.pixels_at_one_metre == 0.0) {
      const double z = depth(attempt.x);
      state.pixels_at_one_metre = static_cast<double>(synthesis.pixels.size()) * z * z;
    }
  });
  state.gathered_at = attempt.x.head<4>();
  state.views += 1.0;
}

TrackFrame FaceTracker::Impl::report(int frame, double time_s, TrackStatus status,
                                     const Attempt& attempt) const {
  TrackFrame out;
  out.frame = frame;
  out.time_s = time_s;
  out.status = status;
  if (status == TrackStatus::lost) {
    if (!attempt.reason.empty()) out.extra["reason"] = attempt.reason;
    return out;
  }
  const Eigen::Index size = attempt.equations.hessian.rows();
  Eigen::MatrixXd covariance =
      kDiscrepancy * kDiscrepancy *
      attempt.equations.hessian.ldlt().solve(Eigen::MatrixXd::Identity(size, size));
  covariance.diagonal().head<3>().array() += std::pow(state.head_rotation_sigma, 2.0);
  covariance.diagonal().segment<3>(3) += (kHeadSize * attempt.x.segment<3>(4)).cwiseAbs2();
  write_estimate(attempt.x, covariance.topLeftCorner<3, 3>(), covariance.diagonal().cwiseSqrt(),
                 out);
  out.residual_rms = attempt.statistics.rms;
  out.inlier_fraction = attempt.statistics.inlier_fraction;
  out.extra["correlation"] = attempt.statistics.correlation;
  return out;
}

void FaceTracker::Impl::write_estimate(const Eigen::VectorXd& x,
                                       const Eigen::Matrix3d& rotation_covariance,
                                       const Eigen::VectorXd& tangent_sigma,
                                       TrackFrame& out) const {
  const ParameterSpace& all = generic.parameters();
  const Eigen::Index identities = state.identity.size();
  const Eigen::Index expressions = all.size() - 7 - identities;
  out.x.resize(all.size());
  out.x << x.head<7>(), state.identity, x.tail(expressions);
  // q(d) = exp(d) q: its derivative at d = 0 maps rotation vectors to quaternion entries.
  const Eigen::Vector4d q = x.head<4>();
  Eigen::Matrix<double, 4, 3> lift;
  lift << -q[1], -q[2], -q[3], q[0], q[3], -q[2], -q[3], q[0], q[1], q[2], -q[1], q[0];
  lift *= 0.5;
  out.sigma.resize(all.size());
  out.sigma << (lift * rotation_covariance * lift.transpose()).diagonal().cwiseSqrt(),
      tangent_sigma.segment<3>(3), state.identity_sigma, tangent_sigma.tail(expressions);
  out.rotation_wxyz = q;
  out.translation_m = x.segment<3>(4);
  Scene scene;
  person->model.synthesize(x, scene);
  out.landmarks_px.clear();
  for (const ModelLandmark& landmark : person->model.landmarks()) {
    const auto& corners = person->topology.triangles[static_cast<std::size_t>(landmark.triangle)];
    Eigen::Vector3f p = Eigen::Vector3f::Zero();
    for (int k = 0; k < 3; ++k) {
      p += landmark.barycentric[k] * scene.objects[0].positions_m.row(corners[k]).transpose();
    }
    out.landmarks_px.push_back(project_world(camera, p.cast<double>()));
  }
}

FaceTracker::FaceTracker(MorphShape shape, const Camera& camera, const FaceTrackerOptions& options)
    : impl_(std::make_unique<Impl>(std::move(shape), camera, options)) {}
FaceTracker::~FaceTracker() = default;

const ParameterSpace& FaceTracker::parameters() const { return impl_->generic.parameters(); }

std::vector<std::string> FaceTracker::landmark_names() const {
  std::vector<std::string> names;
  for (const ModelLandmark& landmark : impl_->generic.landmarks()) names.push_back(landmark.name);
  return names;
}

int FaceTracker::pyramid_levels() const { return kPyramidLevels; }
bool FaceTracker::has_identity() const { return impl_->state.initialised; }

const MorphShape& FaceTracker::shape() const {
  if (!impl_->person) throw SolverError("no face was found yet");
  return impl_->person->model.shape();
}

Image FaceTracker::texture() const {
  if (!impl_->person) throw SolverError("no face was found yet");
  return impl_->person->appearance.texture();
}

void FaceTracker::pose_scene(const TrackFrame& frame, Scene& scene) const {
  const Eigen::Index identities = impl_->state.identity.size();
  Eigen::VectorXd x(frame.x.size() - identities);
  x << frame.x.head<7>(), frame.x.tail(frame.x.size() - 7 - identities);
  impl_->person->model.synthesize(x, scene);
}

const ParameterSpace& FaceTracker::frame_parameters() const {
  if (!impl_->person) throw SolverError("no face was found yet");
  return impl_->person->model.parameters();
}

ClipFrame FaceTracker::linearize(const TrackFrame& frame, const Observation& observation) const {
  ClipFrame out;
  if (frame.status == TrackStatus::lost) return out;
  const Impl& m = *impl_;
  const Eigen::Index identities = m.state.identity.size();
  out.x.resize(frame.x.size() - identities);
  out.x << frame.x.head<7>(), frame.x.tail(frame.x.size() - 7 - identities);
  const ObservationLevel& level = observation.levels.front();
  const Impl::Comparison look = m.compare_at(level, out.x, m.state.light, 3);
  const PhotometricCost cost(&level, &m.person->appearance, &m.person->topology,
                             &m.person->triangle_weight, look.photometric);
  const ContourCost contour(look.contour, &m.person->topology);
  const PriorCost prior(m.person->model.parameters());
  const SynthesisObjective objective(m.person->workspace, out.x, m.free_blocks(), look.light,
                                     m.camera, {&cost, &contour, &prior});
  NormalEquations equations;
  if (objective.normal_equations(out.x, equations)) out.model = std::move(equations);
  return out;
}

void FaceTracker::replace_estimate(const SmoothedFrame& smoothed, TrackFrame& frame) const {
  if (smoothed.state == SmoothedState::lost) return;
  const Eigen::Matrix3d rotation_covariance =
      smoothed.sigma.head<3>().cwiseAbs2().asDiagonal().toDenseMatrix();
  impl_->write_estimate(smoothed.x, rotation_covariance, smoothed.sigma, frame);
}

void FaceTracker::learn_person(const std::vector<Keyframe>& keyframes) {
  Impl& m = *impl_;
  State& s = m.state;
  const FaceBundle bundle = adjust_bundle(m.fitter, m.generic, m.camera, keyframes);
  s = State();
  s.identity = bundle.identity;
  s.identity_sigma = bundle.identity_sigma;
  m.make_person(s.identity);
  s.velocity = Eigen::VectorXd::Zero(6);
  s.initialised = true;
  s.tracking = true;
  s.head_rotation_sigma = bundle.rotation_sigma_rad.norm() / std::sqrt(3.0);
  const Eigen::Index expressions = bundle.x.front().size() - 7 - s.identity.size();
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    Impl::Attempt view;
    view.x.resize(7 + expressions);
    view.x << bundle.x[k].head<7>(), bundle.x[k].tail(expressions);
    view.light = bundle.light[k];
    if (k == 0) {
      s.x = view.x;
      s.first_view = view.x.head<4>();
      s.light = view.light;
    }
    m.gather(*keyframes[k].observation, view, true);
  }
}

TrackFrame FaceTracker::track(int frame, double time_s, const Observation& observation) {
  Impl& m = *impl_;
  State& s = m.state;
  TrackStatus status = TrackStatus::tracked;
  Impl::Attempt attempt;
  if (!s.initialised) {
    if (!m.start(observation)) {
      attempt.reason = "no face found";
      return m.report(frame, time_s, TrackStatus::lost, attempt);
    }
    attempt = m.fit_frame(observation, s.x, 1.0, *m.polish);
  } else if (s.tracking) {
    Eigen::VectorXd step = Eigen::VectorXd::Zero(m.person->model.parameters().tangent_size());
    step.head<6>() = kVelocityDamping * s.velocity;
    attempt =
        m.fit_frame(observation, m.person->model.parameters().plus(s.x, step), 1.0, *m.optimizer);
    if (!attempt.believed) {
      attempt = m.search(observation);
      if (attempt.believed) status = TrackStatus::reinitialised;
    }
  } else {
    attempt = m.search(observation);
    status = TrackStatus::reinitialised;
  }
  if (!attempt.believed) {
    s.tracking = false;
    s.velocity.setZero();
    return m.report(frame, time_s, TrackStatus::lost, attempt);
  }
  if (s.tracking && status == TrackStatus::tracked) {
    s.velocity = m.person->model.parameters().minus(attempt.x, s.x).head<6>();
  } else {
    s.velocity.setZero();
  }
  s.tracking = true;
  s.x = attempt.x;
  s.light = attempt.light;
  // Slow averages: one bad frame must not change what counts as an outlier in the next.
  s.sigma = std::clamp(0.9 * s.sigma + 0.1 * attempt.statistics.sigma, kLeastSigma, kLargestSigma);
  const double rho = std::clamp(attempt.statistics.lag_correlation, 0.0, 0.9);
  const double area = std::pow((1.0 + rho) / (1.0 - rho), 2.0);
  s.correlation_area_px =
      0.9 * s.correlation_area_px +
      0.1 * std::clamp(area, kLeastCorrelationArea_px2, kLargestCorrelationArea_px2);
  const TrackFrame out = m.report(frame, time_s, status, attempt);
  const auto turn_from = [&](const Eigen::Vector4d& view) {
    return 2.0 * std::acos(std::min(1.0, std::abs(view.dot(attempt.x.head<4>()))));
  };
  if ((s.views < kFirstViews || turn_from(s.gathered_at) > kGatherTurn) &&
      turn_from(s.first_view) < kLargestGatherTurn &&
      attempt.statistics.correlation > kGatherCorrelation) {
    m.gather(observation, attempt, false);
  }
  return out;
}

void FaceTracker::save_state(std::ostream& out) const {
  const State& s = impl_->state;
  const double flags[2] = {s.initialised ? 1.0 : 0.0, s.tracking ? 1.0 : 0.0};
  write_vector(out, flags, 2);
  if (!s.initialised) return;
  write_vector(out, s.identity.data(), static_cast<std::uint64_t>(s.identity.size()));
  write_vector(out, s.identity_sigma.data(), static_cast<std::uint64_t>(s.identity_sigma.size()));
  write_vector(out, s.x.data(), static_cast<std::uint64_t>(s.x.size()));
  write_vector(out, s.velocity.data(), 6);
  const double scalars[5] = {s.sigma, s.correlation_area_px, s.pixels_at_one_metre, s.views,
                             s.head_rotation_sigma};
  write_vector(out, scalars, 5);
  write_vector(out, s.gathered_at.data(), 4);
  write_vector(out, s.first_view.data(), 4);
  Eigen::Matrix<double, 27, 1> light;
  for (int k = 0; k < 9; ++k) light.segment<3>(3 * k) = s.light.coefficients[k].cast<double>();
  write_vector(out, light.data(), 27);
  const std::vector<float>& texels = impl_->person->appearance.state();
  const Eigen::VectorXd wide =
      Eigen::Map<const Eigen::VectorXf>(texels.data(), static_cast<Eigen::Index>(texels.size()))
          .cast<double>();
  write_vector(out, wide.data(), static_cast<std::uint64_t>(wide.size()));
}

void FaceTracker::restore_state(std::istream& in, const std::string& source) {
  State s;
  double flags[2];
  read_vector(in, flags, 2, source);
  s.initialised = flags[0] > 0.0;
  s.tracking = flags[1] > 0.0;
  if (s.initialised) {
    const MorphShape& shape = impl_->generic.shape();
    s.identity.resize(shape.identity_count);
    s.identity_sigma.resize(shape.identity_count);
    s.x.resize(impl_->generic.parameters().size() - shape.identity_count);
    s.velocity.resize(6);
    read_vector(in, s.identity.data(), static_cast<std::uint64_t>(s.identity.size()), source);
    read_vector(in, s.identity_sigma.data(), static_cast<std::uint64_t>(s.identity.size()), source);
    read_vector(in, s.x.data(), static_cast<std::uint64_t>(s.x.size()), source);
    read_vector(in, s.velocity.data(), 6, source);
    double scalars[5];
    read_vector(in, scalars, 5, source);
    s.sigma = scalars[0];
    s.correlation_area_px = scalars[1];
    s.pixels_at_one_metre = scalars[2];
    s.views = scalars[3];
    s.head_rotation_sigma = scalars[4];
    read_vector(in, s.gathered_at.data(), 4, source);
    read_vector(in, s.first_view.data(), 4, source);
    Eigen::Matrix<double, 27, 1> light;
    read_vector(in, light.data(), 27, source);
    for (int k = 0; k < 9; ++k) s.light.coefficients[k] = light.segment<3>(3 * k).cast<float>();
    impl_->make_person(s.identity);
    std::vector<float>& texels = impl_->person->appearance.state();
    Eigen::VectorXd wide(static_cast<Eigen::Index>(texels.size()));
    read_vector(in, wide.data(), static_cast<std::uint64_t>(wide.size()), source);
    Eigen::Map<Eigen::VectorXf>(texels.data(), wide.size()) = wide.cast<float>();
    impl_->person->appearance.rebuild();
  }
  impl_->state = std::move(s);
}

}  // namespace semblance
