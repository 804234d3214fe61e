// Every optimizer on the same frames of a clip, from the same starts, with the same objective.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "semblance/core/progress.h"
#include "semblance/optim/optimizer.h"

namespace semblance {

struct CompareOptions {
  std::string video;   // a clip with one face
  std::string camera;  // semblance.camera/1
  std::string truth;   // semblance.track/1 with landmarks of every frame
  std::string model = "builtin";
  int frames = 20;  // spread evenly over the frames that are tracked
  std::uint64_t seed = 1;
  std::vector<int> gradient_budgets = {10, 50};           // iterations of lm and ceres
  std::vector<int> sampling_budgets = {250, 1000, 4000};  // evaluations of the others
};

/// One minimisation on one frame.
struct ComparedSolution {
  double cost = 0.0;
  std::int64_t evaluations = 0;
  double seconds = 0.0;
  double to_best_px = 0.0;   // mean distance of the landmarks from those of the least cost
  double to_truth_px = 0.0;  // and from the true ones
  std::vector<TracePoint> trace;
};

/// A method with one budget; entry i of `solutions` belongs to entry i of the compared frames.
struct ComparedMethod {
  std::string name;
  int budget = 0;
  std::vector<ComparedSolution> solutions;
};

struct OptimizerComparison {
  std::vector<int> frames;
  int parameters = 0;  // that are solved for
  int threads = 0;
  std::vector<ComparedSolution> starts;  // no evaluations: where every method began
  std::vector<double> least_cost;        // of all methods on that frame
  std::vector<ComparedMethod> methods;
};

/// Tracks the clip with Levenberg-Marquardt. Then, on each chosen frame, moves the tracked pose by
/// about 3 degrees, 1 % of the distance and 0.1 in every expression, and has every method minimise
/// photometric cost at full resolution plus the model's priors from there. Person, texture (of the
/// first tracked frame) and light are fixed. Samplers search three deviations of that displacement
/// to each side of the start. All but the seconds is the same for a seed.
///
/// Throws InvalidInput where the files do not fit together, SolverError if too few frames could be
/// tracked or the work was cancelled.
OptimizerComparison compare_optimizers(const CompareOptions& options, Progress& progress);

/// Medians over the frames, as text and as one JSON object: a line per method and budget, and the
/// cost above the least at milestones of evaluations and of seconds (largest budget of each).
std::string comparison_table(const OptimizerComparison& comparison);
std::string comparison_json(const OptimizerComparison& comparison);

}  // namespace semblance
