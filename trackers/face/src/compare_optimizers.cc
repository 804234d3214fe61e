#include "semblance/face/compare_optimizers.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>

#include "face_parts.h"
#include "semblance/core/errors.h"
#include "semblance/core/parallel.h"
#include "semblance/core/random.h"
#include "semblance/cost/light.h"
#include "semblance/cost/photometric.h"
#include "semblance/cost/prior.h"
#include "semblance/face/face_tracker.h"
#include "semblance/io/camera_io.h"
#include "semblance/models/load_face.h"
#include "semblance/pipeline/frame_feed.h"

namespace semblance {

namespace {

// The displacement of the starts.
constexpr double kRotation = 3.0 * std::numbers::pi / 180.0;  // about a random axis
constexpr double kTranslationShare = 0.01;  // of the distance, in a random direction
constexpr double kExpression = 0.1;         // deviation, each
constexpr double kSearchDeviations = 3.0;

constexpr double kSigma = 0.03, kCorrelationArea_px = 40.0;
constexpr int kTextureSize = 512;
constexpr double kNear_px = 0.5;  // a solution this close to the best has found its basin

using Points2 = std::vector<Eigen::Vector2d>;

/// Steps as large as the starts are wrong.
Eigen::VectorXd start_sigma(const ParameterSpace& space, double distance_m) {
  Eigen::VectorXd sigma = Eigen::VectorXd::Constant(space.tangent_size(), kExpression);
  sigma.head<3>().setConstant(kRotation);
  sigma.segment<3>(3).setConstant(kTranslationShare * distance_m);
  return sigma;
}

/// The person, with the texture of one frame.
class TexturedPerson {
 public:
  TexturedPerson(const MorphShape& shape, const Camera& camera)
      : model_(shape),
        topology_(topology_of(model_)),
        workspace_(model_, topology_),
        appearance_(*model_.shape().mesh, kTextureSize, vertex_albedo(model_.shape()),
                    unseen_confidence(model_.shape())),
        triangle_weight_(triangle_weights(model_.shape(), topology_, tracking_weight)),
        camera_(camera) {
    for (std::size_t b = 0; b < model_.parameters().blocks().size(); ++b) {
      blocks_.push_back(static_cast<int>(b));
    }
  }

  /// Takes the texture from the picture of a face at x.
  void gather(const Observation& observation, const Eigen::VectorXd& x) {
    const ShLight light = light_at(observation, x);
    const SynthesisObjective probe(workspace_, x, blocks_, light, camera_, {});
    probe.with_synthesis(x, [&](const Synthesis& synthesis) {
      const std::vector<float> flat(synthesis.pixels.size(), 1.0f);
      appearance_.gather(observation.linear, synthesis.scene.objects[0], camera_, light,
                         synthesis.pixels, flat);
    });
  }

  /// The light that explains the picture best with the face at x.
  ShLight light_at(const Observation& observation, const Eigen::VectorXd& x) {
    constexpr int rounds = 3;  // outliers are known better with the light of the round before
    ShLight light;
    for (int round = 0; round < rounds; ++round) {
      const SynthesisObjective probe(workspace_, x, blocks_, light, camera_, {});
      probe.with_synthesis(x, [&](const Synthesis& synthesis) {
        const PhotometricCost cost = photometric(observation, options_at(synthesis));
        const std::vector<float> weight = cost.statistics(synthesis).pixel_weight;
        light = estimate_light(synthesis, observation.levels[0], appearance_, topology_, weight,
                               {.pull = 0.05, .order = 2, .stride = 3});
      });
    }
    return light;
  }

  PhotometricOptions photometric_options(const Eigen::VectorXd& x) {
    PhotometricOptions options;
    const SynthesisObjective probe(workspace_, x, blocks_, {}, camera_, {});
    probe.with_synthesis(x, [&](const Synthesis& synthesis) { options = options_at(synthesis); });
    return options;
  }

  PhotometricCost photometric(const Observation& observation, const PhotometricOptions& options) {
    return {&observation.levels[0], &appearance_, &topology_, &triangle_weight_, options};
  }

  SynthesisObjective objective(const Eigen::VectorXd& x, const ShLight& light,
                               std::vector<const Cost*> costs) {
    return {workspace_, x, blocks_, light, camera_, std::move(costs)};
  }

  Points2 landmarks_px(const Eigen::VectorXd& x) const {
    Scene scene;
    model_.synthesize(x, scene);
    Points2 out;
    for (const ModelLandmark& landmark : model_.landmarks()) {
      const auto& corners = topology_.triangles[static_cast<std::size_t>(landmark.triangle)];
      Eigen::Vector3f p = Eigen::Vector3f::Zero();
      for (int k = 0; k < 3; ++k) {
        p += landmark.barycentric[k] * scene.objects[0].positions_m.row(corners[k]).transpose();
      }
      out.push_back(project_world(camera_, p.cast<double>()));
    }
    return out;
  }

  double distance_m(const Eigen::VectorXd& x) const {
    return (camera_.camera_from_world * Eigen::Vector3d(x.segment<3>(4))).norm();
  }
  const ParameterSpace& space() const { return model_.parameters(); }

 private:
  PhotometricOptions options_at(const Synthesis& synthesis) const {
    PhotometricOptions options;
    options.sigma = kSigma;
    options.correlation_area_px = kCorrelationArea_px;
    options.reference_pixels = static_cast<double>(synthesis.pixels.size());
    options.texture_level = matching_texture_level(synthesis, appearance_, topology_);
    return options;
  }

  MorphModel model_;
  SurfaceTopology topology_;
  SynthesisWorkspace workspace_;
  Appearance appearance_;
  std::vector<float> triangle_weight_;
  Camera camera_;
  std::vector<int> blocks_;
};

double mean_distance(const Points2& a, const Points2& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]).norm();
  return sum / static_cast<double>(a.size());
}

/// x moved away from the minimum, the same for a seed and frame.
Eigen::VectorXd displaced(const ParameterSpace& space, const Eigen::VectorXd& x, double distance_m,
                          std::uint64_t seed, int frame) {
  Random random(seed, static_cast<std::uint64_t>(frame));
  Eigen::VectorXd step = random.normal_vector(space.tangent_size());
  step.head<3>() = kRotation * step.head<3>().normalized();
  step.segment<3>(3) = kTranslationShare * distance_m * step.segment<3>(3).normalized();
  step.tail(step.size() - 6) *= kExpression;
  return space.plus(x, step);
}

bool uses_gradient(const std::string& method) { return method == "lm" || method == "ceres"; }

std::unique_ptr<Optimizer> make_compared(const std::string& name, int budget, std::uint64_t seed) {
  OptimizerOptions options;
  options.max_iterations = budget;
  options.max_evaluations = budget;
  options.search_radius = kSearchDeviations;
  options.seed = seed;
  return make_optimizer(name, options);
}

std::map<int, Points2> read_truth(const std::string& path, std::size_t landmarks) {
  std::map<int, Points2> truth;
  for (const TrackFrame& frame : read_track(path).frames) {
    if (frame.landmarks_px.size() != landmarks) {
      throw InvalidInput(path + ": frame " + std::to_string(frame.frame) + " has " +
                         std::to_string(frame.landmarks_px.size()) + " landmarks, but the model " +
                         std::to_string(landmarks) + "; give the clip's own truth and model");
    }
    truth[frame.frame] = frame.landmarks_px;
  }
  return truth;
}

/// All the clip's frames with an estimate.
std::vector<TrackFrame> track_clip(const CompareOptions& options, const Camera& camera,
                                   FaceTracker& tracker, Progress& progress) {
  std::vector<TrackFrame> tracked;
  FrameFeed feed(options.video, camera, tracker.pyramid_levels(), 0);
  progress.begin("tracking", 0);
  while (std::optional<PreparedFrame> frame = feed.next()) {
    TrackFrame result = tracker.track(frame->index, 0.0, frame->observation);
    if (result.status != TrackStatus::lost) tracked.push_back(std::move(result));
    progress.update(frame->index + 1);
    if (progress.cancelled()) throw SolverError("interrupted; nothing was compared");
  }
  progress.end();
  if (static_cast<int>(tracked.size()) <= options.frames) {
    throw SolverError(options.video + ": only " + std::to_string(tracked.size()) +
                      " frames could be tracked, and one more than the " +
                      std::to_string(options.frames) + " to be compared are needed");
  }
  return tracked;
}

/// `count` frames evenly spread over those after the first, which gave the texture.
std::vector<TrackFrame> spread(const std::vector<TrackFrame>& tracked, int count) {
  std::vector<TrackFrame> chosen;
  const auto available = static_cast<int>(tracked.size()) - 1;
  for (int i = 0; i < count; ++i) {
    const int at = 1 + static_cast<int>((2LL * i + 1) * available / (2LL * count));
    chosen.push_back(tracked[static_cast<std::size_t>(at)]);
  }
  return chosen;
}

Eigen::VectorXd without_identity(const Eigen::VectorXd& x, const ParameterSpace& person) {
  Eigen::VectorXd out(person.size());
  out << x.head<7>(), x.tail(person.size() - 7);
  return out;
}

void compare_frame(const CompareOptions& options, TexturedPerson& person, const TrackFrame& tracked,
                   const Observation& observation, const Points2& truth,
                   OptimizerComparison& comparison, Progress& progress) {
  const Eigen::VectorXd x = without_identity(tracked.x, person.space());
  const PhotometricCost photometric =
      person.photometric(observation, person.photometric_options(x));
  const PriorCost prior(person.space());
  SynthesisObjective objective =
      person.objective(x, person.light_at(observation, x), {&photometric, &prior});
  objective.set_step_scale(start_sigma(objective.space(), person.distance_m(x)));
  const Eigen::VectorXd start =
      displaced(person.space(), x, person.distance_m(x), options.seed, tracked.frame);
  ComparedSolution at_start;
  at_start.cost = objective.evaluate(start);
  if (!std::isfinite(at_start.cost)) {
    throw SolverError("frame " + std::to_string(tracked.frame) + ": the start has no cost");
  }

  double least = at_start.cost;
  Eigen::VectorXd best = start;
  std::vector<Eigen::VectorXd> found;
  for (ComparedMethod& method : comparison.methods) {
    const auto begin = std::chrono::steady_clock::now();
    Solution solution = make_compared(method.name, method.budget, options.seed)
                            ->minimize(objective, start, progress);
    if (progress.cancelled()) throw SolverError("interrupted; the comparison is not complete");
    ComparedSolution out;
    out.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    out.cost = solution.cost;
    out.evaluations = solution.evaluations;
    out.trace = std::move(solution.trace);
    method.solutions.push_back(std::move(out));
    if (solution.cost < least) {
      least = solution.cost;
      best = solution.x;
    }
    found.push_back(std::move(solution.x));
  }
  const Points2 best_px = person.landmarks_px(best);
  const auto measure = [&](const Eigen::VectorXd& at, ComparedSolution& out) {
    const Points2 landmarks = person.landmarks_px(at);
    out.to_best_px = mean_distance(landmarks, best_px);
    out.to_truth_px = mean_distance(landmarks, truth);
  };
  measure(start, at_start);
  for (std::size_t m = 0; m < found.size(); ++m) {
    measure(found[m], comparison.methods[m].solutions.back());
  }
  comparison.frames.push_back(tracked.frame);
  comparison.starts.push_back(std::move(at_start));
  comparison.least_cost.push_back(least);
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

template <class Value>
double median_over(std::size_t count, Value value) {
  std::vector<double> values;
  for (std::size_t i = 0; i < count; ++i) values.push_back(value(i));
  return median(std::move(values));
}

struct Medians {
  double evaluations, seconds, excess, to_best_px, to_truth_px;
  int near_best;  // solutions within kNear_px of the best
};

Medians medians_of(const std::vector<ComparedSolution>& solutions,
                   const std::vector<double>& least_cost) {
  const std::size_t n = solutions.size();
  Medians out{};
  out.evaluations =
      median_over(n, [&](std::size_t i) { return static_cast<double>(solutions[i].evaluations); });
  out.seconds = median_over(n, [&](std::size_t i) { return solutions[i].seconds; });
  out.excess = median_over(n, [&](std::size_t i) { return solutions[i].cost - least_cost[i]; });
  out.to_best_px = median_over(n, [&](std::size_t i) { return solutions[i].to_best_px; });
  out.to_truth_px = median_over(n, [&](std::size_t i) { return solutions[i].to_truth_px; });
  out.near_best = static_cast<int>(
      std::count_if(solutions.begin(), solutions.end(),
                    [](const ComparedSolution& s) { return s.to_best_px <= kNear_px; }));
  return out;
}

constexpr std::array kEvaluationMilestones = {5, 10, 20, 50, 100, 250, 500, 1000, 2000, 4000};
constexpr std::array kSecondMilestones = {0.01, 0.03, 0.1, 0.3, 1.0, 3.0};

/// Median cost above the least after what `within` admits of the trace.
template <class Within>
double excess_at(const OptimizerComparison& c, const ComparedMethod& method, Within within) {
  return median_over(method.solutions.size(), [&](std::size_t i) {
    double cost = c.starts[i].cost;
    for (const TracePoint& point : method.solutions[i].trace) {
      if (within(point)) cost = std::min(cost, point.cost);
    }
    return cost - c.least_cost[i];
  });
}

std::vector<double> excess_by_evaluations(const OptimizerComparison& c, const ComparedMethod& m) {
  std::vector<double> out;
  for (const int limit : kEvaluationMilestones) {
    out.push_back(excess_at(c, m, [&](const TracePoint& p) { return p.evaluations <= limit; }));
  }
  return out;
}

std::vector<double> excess_by_seconds(const OptimizerComparison& c, const ComparedMethod& m) {
  std::vector<double> out;
  for (const double limit : kSecondMilestones) {
    out.push_back(excess_at(c, m, [&](const TracePoint& p) { return p.seconds <= limit; }));
  }
  return out;
}

/// The methods with the largest budget of each.
std::vector<const ComparedMethod*> longest(const OptimizerComparison& c) {
  std::vector<const ComparedMethod*> out;
  for (const ComparedMethod& method : c.methods) {
    if (!out.empty() && out.back()->name == method.name) {
      if (method.budget > out.back()->budget) out.back() = &method;
    } else {
      out.push_back(&method);
    }
  }
  return out;
}

std::string table_line(const std::string& name, const std::string& budget, const Medians& m,
                       std::size_t frames) {
  return fmt::format("{:<12} {:>6} {:>11.0f} {:>8.3f} {:>10.2f} {:>11.2f} {:>12.2f} {:>6}\n", name,
                     budget, m.evaluations, m.seconds, m.excess, m.to_best_px, m.to_truth_px,
                     fmt::format("{}/{}", m.near_best, frames));
}

}  // namespace

OptimizerComparison compare_optimizers(const CompareOptions& options, Progress& progress) {
  if (options.frames < 1) throw InvalidInput("the number of frames must be at least 1");
  const Camera distorted = read_camera(options.camera);
  const Camera camera = distorted.without_distortion();
  const MorphShape shape = load_face(options.model);
  const std::map<int, Points2> truth = read_truth(options.truth, shape.landmarks.size());
  FaceTrackerOptions tracking;
  tracking.seed = options.seed;
  FaceTracker tracker(shape, camera, tracking);
  const std::vector<TrackFrame> tracked = track_clip(options, distorted, tracker, progress);
  const std::vector<TrackFrame> chosen = spread(tracked, options.frames);
  TexturedPerson person(tracker.shape(), camera);

  OptimizerComparison comparison;
  comparison.parameters = static_cast<int>(person.space().tangent_size());
  comparison.threads = thread_count();
  for (const std::string& name : optimizer_names()) {
    for (const int budget :
         uses_gradient(name) ? options.gradient_budgets : options.sampling_budgets) {
      comparison.methods.push_back({name, budget, {}});
    }
  }
  FrameFeed feed(options.video, distorted, 1, 0);
  progress.begin("comparing", static_cast<std::int64_t>(chosen.size()));
  while (std::optional<PreparedFrame> frame = feed.next()) {
    const std::size_t done = comparison.frames.size();
    if (done == chosen.size()) break;
    if (frame->index == tracked.front().frame) {
      person.gather(frame->observation, without_identity(tracked.front().x, person.space()));
    }
    if (frame->index != chosen[done].frame) continue;
    const auto known = truth.find(frame->index);
    if (known == truth.end()) {
      throw InvalidInput(options.truth + ": has no line for frame " + std::to_string(frame->index) +
                         "; give the clip's own truth");
    }
    compare_frame(options, person, chosen[done], frame->observation, known->second, comparison,
                  progress);
    progress.update(static_cast<std::int64_t>(done) + 1);
  }
  progress.end();
  return comparison;
}

std::string comparison_table(const OptimizerComparison& c) {
  const std::size_t n = c.frames.size();
  std::string out = fmt::format("{} frames, {} parameters, {} threads; medians over the frames\n\n",
                                n, c.parameters, c.threads);
  out += "method       budget evaluations  seconds     excess  px to best  px to truth   near\n";
  out += table_line("(start)", "-", medians_of(c.starts, c.least_cost), n);
  for (const ComparedMethod& method : c.methods) {
    out += table_line(method.name, std::to_string(method.budget),
                      medians_of(method.solutions, c.least_cost), n);
  }
  out += "\nexcess after N evaluations\nmethod      ";
  for (const int limit : kEvaluationMilestones) out += fmt::format(" {:>8}", limit);
  for (const ComparedMethod* method : longest(c)) {
    out += fmt::format("\n{:<12}", method->name);
    for (const double excess : excess_by_evaluations(c, *method)) {
      out += fmt::format(" {:>8.2f}", excess);
    }
  }
  out += "\n\nexcess after S seconds\nmethod      ";
  for (const double limit : kSecondMilestones) out += fmt::format(" {:>8}", limit);
  for (const ComparedMethod* method : longest(c)) {
    out += fmt::format("\n{:<12}", method->name);
    for (const double excess : excess_by_seconds(c, *method))
      out += fmt::format(" {:>8.2f}", excess);
  }
  return out + "\n";
}

std::string comparison_json(const OptimizerComparison& c) {
  const auto entry = [&](const std::vector<ComparedSolution>& solutions) {
    const Medians m = medians_of(solutions, c.least_cost);
    return nlohmann::json{{"evaluations", m.evaluations}, {"seconds", m.seconds},
                          {"excess_cost", m.excess},      {"to_best_px", m.to_best_px},
                          {"to_truth_px", m.to_truth_px}, {"near_best", m.near_best}};
  };
  nlohmann::json json = {
      {"frames", c.frames},
      {"parameters", c.parameters},
      {"threads", c.threads},
      {"near_px", kNear_px},
      {"start", entry(c.starts)},
      {"milestones", {{"evaluations", kEvaluationMilestones}, {"seconds", kSecondMilestones}}},
      {"methods", nlohmann::json::array()},
      {"curves", nlohmann::json::array()}};
  for (const ComparedMethod& method : c.methods) {
    nlohmann::json line = entry(method.solutions);
    line["method"] = method.name;
    line["budget"] = method.budget;
    json["methods"].push_back(std::move(line));
  }
  for (const ComparedMethod* method : longest(c)) {
    json["curves"].push_back({{"method", method->name},
                              {"budget", method->budget},
                              {"excess_by_evaluations", excess_by_evaluations(c, *method)},
                              {"excess_by_seconds", excess_by_seconds(c, *method)}});
  }
  return json.dump(2);
}

}  // namespace semblance
