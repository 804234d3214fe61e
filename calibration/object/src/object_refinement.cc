#include "object_refinement.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "outline_comparison.h"
#include "semblance/core/errors.h"
#include "semblance/core/parallel.h"
#include "semblance/cost/light.h"
#include "semblance/cost/photometric.h"
#include "semblance/optim/optimizer.h"
#include "sharp_outline.h"

namespace semblance {
namespace {

constexpr int kStages = 3;          // of the pyramid, the last the finest
constexpr int kMostRounds = 8;      // of one stage
constexpr double kStill_px = 0.03;  // a round that moves less ends its stage
constexpr double kFinest_px = 1000.0, kCoarsest_px = 80.0;  // sizes of the object in the picture
constexpr double kReach_px = 8.0, kCorrelation_px = 10.0;
constexpr double kLeastSigma_px = 0.2, kMostSigma_px = 1.5;  // of the outline
constexpr std::size_t kLeastPixels = 100;
constexpr double kLeastOutline = 0.2, kLeastCorrelation = 0.5;

bool has_colours(const ObjectTarget& target) { return target.appearance.has_value(); }

/// Length of the border between what shows the object and what does not, by counting steps
/// (Cauchy's formula: the mean over directions is 4 / pi steps to the pixel).
double outline_length_px(const VisiblePixels& seen, int width) {
  double steps = 0.0;
  std::size_t below = 0;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const std::int32_t pixel = seen.pixel[i];
    if (i + 1 == seen.size() || seen.pixel[i + 1] != pixel + 1) steps += 2.0;
    while (below < seen.size() && seen.pixel[below] < pixel + width) ++below;
    if (below == seen.size() || seen.pixel[below] != pixel + width) steps += 2.0;
  }
  return steps * std::numbers::pi / 4.0;
}

double box_size_px(const Synthesis& synthesis) {
  Eigen::AlignedBox2d box;
  const int width = synthesis.camera.width;
  for (const std::int32_t pixel : synthesis.pixels.pixel) {
    box.extend(Eigen::Vector2d(pixel % width, pixel / width));
  }
  return box.isEmpty() ? 0.0 : box.sizes().maxCoeff();
}

double rms_px(const std::vector<ContourTarget>& outline, const Synthesis& synthesis,
              const SurfaceTopology& topology) {
  double sum = 0.0;
  for (const ContourTarget& target : outline) {
    const auto& corner = topology.triangles[static_cast<std::size_t>(target.triangle)];
    Eigen::Vector2f seen = Eigen::Vector2f::Zero();
    for (int k = 0; k < 3; ++k) {
      const float* p = synthesis.projected.data() + std::ptrdiff_t{3} * corner[k];
      seen += target.barycentric[k] * Eigen::Vector2f(p[0], p[1]);
    }
    const double distance = target.normal.dot(seen - target.target_px);
    sum += distance * distance;
  }
  return std::sqrt(sum / std::max<double>(1.0, static_cast<double>(outline.size())));
}

/// Pixels over which residuals are alike, from how much neighbours agree.
double correlation_area_px(double lag_correlation) {
  const double length_px = -1.0 / std::log(std::clamp(lag_correlation, 0.2, 0.95));
  return 2.0 * std::numbers::pi * length_px * length_px;
}

}  // namespace

struct ObjectRefinement::View {
  Observation picture, mask;  // no mask: no levels
  int finest = 0, stages = 1;
  ShLight light;
  bool lit = false;
  ColourComparison::Options options;
  double outline_sigma_px = kMostSigma_px;
  std::vector<ContourTarget> outline;
  std::unique_ptr<ColourComparison> colours;
  std::unique_ptr<OutlineComparison> contour;
  std::size_t pixels = 0;
  ObjectFit fit;

  int level_at(int stage) const { return finest + std::min(kStages - 1 - stage, stages - 1); }
  const ObservationLevel& level(int stage) const {
    return picture.levels[static_cast<std::size_t>(level_at(stage))];
  }

  void choose_levels(double size_px) {
    const auto halvings = [&](double limit_px) {
      return std::max(0,
                      static_cast<int>(std::floor(std::log2(std::max(size_px, 1.0) / limit_px))));
    };
    const int most = static_cast<int>(picture.levels.size()) - 1;
    finest = size_px > kFinest_px ? std::min(halvings(kFinest_px) + 1, most) : 0;
    stages =
        std::clamp(halvings(kCoarsest_px) - finest + 1, 1, std::min(kStages, most - finest + 1));
  }
};

ObjectRefinement::ObjectRefinement(const ObjectTarget& target,
                                   const std::vector<ObjectPicture>& pictures,
                                   const IntrinsicsFreedom& freedom, double pair_sigma_px,
                                   const std::function<bool()>& cancelled)
    : target_(target),
      pictures_(pictures),
      freedom_(freedom),
      pair_sigma_px_(pair_sigma_px),
      cancelled_(cancelled),
      workspace_(target, pictures.size()),
      edges_(contour_edges(
          target.welded,
          std::vector<float>(static_cast<std::size_t>(target.welded.vertex_count), 1.0f))),
      triangle_weight_(target.topology.triangles.size(), 1.0f),
      fits_(pictures.size()) {
  constexpr int levels = 6;
  for (const ObjectPicture& picture : pictures) {
    views_.push_back(std::make_unique<View>());
    views_.back()->picture = make_observation(picture.linear, levels);
    if (!picture.mask.empty()) views_.back()->mask = make_observation(picture.mask, levels);
  }
}

ObjectRefinement::~ObjectRefinement() = default;

ObjectObjective ObjectRefinement::probe(const RefinementState& state, int stage) const {
  std::vector<PictureTerms> terms;
  for (std::size_t k = 0; k < views_.size(); ++k) {
    const View& view = *views_[k];
    PictureTerms term{.scale = view.level(stage).scale,
                      .light = view.light,
                      .pairs = pictures_[k].pairs,
                      .pair_sigma_px = pair_sigma_px_};
    for (ObjectPair& pair : term.pairs) pair.point_m -= target_.centre_m;
    terms.push_back(std::move(term));
  }
  return {workspace_, state.camera, freedom_, std::move(terms), state.poses};
}

PhotometricCost::Statistics ObjectRefinement::facts(const View& view, int stage,
                                                    const Synthesis& synthesis) const {
  PhotometricOptions options;
  options.sigma = view.options.sigma;
  options.robust_width = view.options.robust_width;
  options.texture_level = view.options.texture_level;
  return PhotometricCost(&view.level(stage), &*target_.appearance, &target_.topology,
                         &triangle_weight_, options)
      .statistics(synthesis);
}

void ObjectRefinement::look(const RefinementState& state, int stage) {
  const ObjectObjective objective = probe(state, stage);
  parallel_for(views_.size(), [&](std::size_t k) {
    View& view = *views_[k];
    const ObservationLevel& level = view.level(stage);
    const ObservationLevel& edges_in =
        view.mask.levels.empty() ? level
                                 : view.mask.levels[static_cast<std::size_t>(view.level_at(stage))];
    objective.with_synthesis(objective.start(), k, [&](const Synthesis& synthesis) {
      view.pixels = synthesis.pixels.size();
      view.outline = find_contour(synthesis, edges_in, target_.welded, triangle_weight_, edges_,
                                  {kReach_px, view.outline_sigma_px, kCorrelation_px});
      sharpen_outline(view.outline, edges_in, view.outline_sigma_px);
      view.fit.outline_rms_px = rms_px(view.outline, synthesis, target_.welded) / level.scale;
      view.outline_sigma_px =
          std::clamp(view.fit.outline_rms_px * level.scale, kLeastSigma_px, kMostSigma_px);
      double length_px = 0.0;
      for (const ContourTarget& found : view.outline) length_px += found.weight * kCorrelation_px;
      view.fit.outline_share = std::min(
          1.0,
          length_px / std::max(outline_length_px(synthesis.pixels, synthesis.camera.width), 1.0));
      if (!has_colours(target_) || view.pixels < kLeastPixels) return;
      view.options.texture_level =
          matching_texture_level(synthesis, *target_.appearance, target_.topology);
      const std::vector<float> weight = view.lit ? facts(view, stage, synthesis).pixel_weight
                                                 : std::vector<float>(view.pixels, 1.0f);
      view.light = estimate_light(synthesis, level, *target_.appearance, target_.topology, weight,
                                  {.pull = 1e-3, .order = 2, .stride = 1});
      view.lit = true;
    });
  });
  if (!has_colours(target_)) return;
  const ObjectObjective lit = probe(state, stage);
  parallel_for(views_.size(), [&](std::size_t k) {
    View& view = *views_[k];
    if (view.pixels < kLeastPixels) return;
    lit.with_synthesis(lit.start(), k, [&](const Synthesis& synthesis) {
      const PhotometricCost::Statistics found = facts(view, stage, synthesis);
      view.options.sigma = std::clamp(found.sigma, 0.01, 0.15);
      view.options.correlation_area_px = correlation_area_px(found.lag_correlation);
      view.options.reference_pixels = static_cast<double>(view.pixels);
      view.fit.colour_rms = found.rms;
      view.fit.colour_correlation = found.correlation;
    });
  });
}

ObjectObjective ObjectRefinement::comparison(const RefinementState& state, int stage) const {
  std::vector<PictureTerms> terms;
  for (std::size_t k = 0; k < views_.size(); ++k) {
    View& view = *views_[k];
    PictureTerms term{.scale = view.level(stage).scale,
                      .light = view.light,
                      .pairs = pictures_[k].pairs,
                      .pair_sigma_px = pair_sigma_px_};
    for (ObjectPair& pair : term.pairs) pair.point_m -= target_.centre_m;
    view.contour = std::make_unique<OutlineComparison>(view.outline, target_.topology);
    term.outline = view.contour.get();
    if (has_colours(target_)) {
      view.colours = std::make_unique<ColourComparison>(target_, view.level(stage), view.options);
      term.colours = view.colours.get();
    }
    terms.push_back(std::move(term));
  }
  return {workspace_, state.camera, freedom_, std::move(terms), state.poses};
}

ObjectRefinement::Solved ObjectRefinement::solve(const RefinementState& state, int stage) const {
  const ObjectObjective objective = comparison(state, stage);
  OptimizerOptions options;
  options.max_iterations = 8;
  const Solution solution =
      make_optimizer("lm", options)->minimize(objective, objective.start(), silent_progress());
  if (solution.termination == Termination::failed) {
    throw SolverError("the comparison with the pictures failed: " + solution.message);
  }
  Solved out;
  out.state.camera = objective.camera(solution.x);
  constexpr Eigen::Index places = 50;
  const Eigen::Index stride = std::max<Eigen::Index>(1, target_.mesh.vertex_count() / places);
  for (std::size_t k = 0; k < views_.size(); ++k) {
    out.state.poses.push_back(objective.pose(solution.x, k));
    for (Eigen::Index v = 0; v < target_.mesh.vertex_count(); v += stride) {
      const Eigen::Vector3d point = target_.mesh.positions_m.row(v);
      const Eigen::Vector2d step = project(out.state.camera, out.state.poses[k] * point) -
                                   project(state.camera, state.poses[k] * point);
      out.motion_px = std::max(out.motion_px, step.norm() * views_[k]->level(stage).scale);
    }
  }
  return out;
}

void ObjectRefinement::check_found() const {
  std::vector<std::string> unseen, unfound;
  for (std::size_t k = 0; k < views_.size(); ++k) {
    const View& view = *views_[k];
    if (view.pixels < kLeastPixels) {
      unseen.push_back(pictures_[k].name);
    } else if (view.fit.outline_share < kLeastOutline &&
               view.fit.colour_correlation < kLeastCorrelation) {
      unfound.push_back(fmt::format("{} (edges along {:.0f} % of the outline)", pictures_[k].name,
                                    100.0 * view.fit.outline_share));
    }
  }
  if (!unseen.empty()) {
    throw SolverError(fmt::format(
        "the object is not in the picture, or hardly, where the pairs put it: {}; check the pairs",
        fmt::join(unseen, ", ")));
  }
  if (!unfound.empty()) {
    throw SolverError(fmt::format(
        "the object's outline was not found in {}; check the pairs, give a mask of the object, or "
        "keep to the pairs",
        fmt::join(unfound, ", ")));
  }
}

void ObjectRefinement::finish(const RefinementState& state) {
  const int stage = kStages - 1;
  look(state, stage);
  const ObjectObjective objective = comparison(state, stage);
  std::vector<PictureComparison> comparisons;
  for (std::size_t k = 0; k < views_.size(); ++k) {
    const View& view = *views_[k];
    comparisons.push_back({view.colours.get(), view.contour.get()});
    fits_[k] = view.fit;
  }
  covariance_ = comparison_covariance(objective, objective.start(), comparisons);
}

RefinementState ObjectRefinement::run(const RefinementState& start) {
  const ObjectObjective whole = probe(start, kStages - 1);
  for (std::size_t k = 0; k < views_.size(); ++k) {
    whole.with_synthesis(whole.start(), k, [&](const Synthesis& synthesis) {
      views_[k]->pixels = synthesis.pixels.size();
      views_[k]->choose_levels(box_size_px(synthesis));
    });
  }
  for (const auto& view : views_) view->fit.outline_share = 1.0;  // until it was looked for
  check_found();
  RefinementState state = start;
  for (int stage = 0; stage < kStages; ++stage) {
    for (int round = 0; round < kMostRounds; ++round) {
      if (cancelled_ && cancelled_()) throw SolverError("stopped before the comparison was done");
      look(state, stage);
      check_found();
      Solved solved = solve(state, stage);
      state = std::move(solved.state);
      ++rounds_;
      if (solved.motion_px < kStill_px) break;
    }
  }
  finish(state);
  check_found();
  return state;
}

}  // namespace semblance
