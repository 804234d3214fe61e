// Runs a scene of cloth until it rests or for a time, and tells what came of it.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "semblance/cloth/cloth_system.h"
#include "semblance/cloth/drape.h"
#include "semblance/cloth/rest.h"
#include "semblance/core/progress.h"

namespace semblance {

/// A scene at any spacing of its vertices.
struct SimulationSetup {
  std::string name;
  std::function<ClothScene(double spacing_m)> make;
  double spacing_m = 0.01;         // the usual one
  std::optional<DrapeTest> drape;  // where the scene is a drape test
  /// False where the sheet is a mesh of its own: `make` ignores the spacing.
  bool has_spacing = true;
};

enum class SimulationMethod {
  dynamic,         // through time, until nothing moves
  quasistatic,     // rest alone: `settle`
  coarse_to_fine,  // rest on a coarse sheet first, then on finer ones that start from it
};

struct SimulationOptions {
  double spacing_m = 0.01;
  SimulationMethod method = SimulationMethod::dynamic;
  std::optional<double> until_s;  // nothing: until rest; dynamic only
  double longest_time_s = 60.0;   // of a dynamic run until rest
  StepOptions step;               // of the dynamic method
  double longest_step_s = 0.01;
  double smallest_step_s = 1e-6;
  /// A step in which the largest elongation grows by more than this is taken again with half its
  /// length; a larger elongation is warned of.
  double strain_limit = 0.05;
  double frames_per_second = 25.0;
  double rest_speed_m_s = 1e-4;  // dynamic: at rest where all are slower and forces balance:
  double rest_residual = 1e-3;   // unbalanced forces over the weight
  RestOptions rest;              // of the other methods
  /// The coarsest level's spacing is at most this, as long as the sheet allows it.
  double coarsest_spacing_m = 0.04;
  double checkpoint_interval_s = 60.0;  // of the wall clock
};

/// One line of a run's log.
struct SimulationRow {
  double time_s = 0.0;  // of quasi-static steps a count of no meaning but order
  double step_s = 0.0;
  double kinetic_j = 0.0, elastic_j = 0.0, gravity_j = 0.0, contact_j = 0.0;
  /// ClothSystem::rest_residual; in motion, where forces are not to be in balance, nothing.
  std::optional<double> residual;
  double speed_m_s = 0.0;
  double elongation = 0.0;  // the largest
  std::int32_t newton_iterations = 0, linear_iterations = 0;
  std::int32_t level = 0, contacts = 0;
};

/// One sheet of a run from coarse to fine; other methods have one level.
struct SimulationLevel {
  double spacing_m = 0.0;
  std::int64_t vertices = 0;
  std::int32_t steps = 0, newton_iterations = 0, linear_iterations = 0;
  double residual = 0.0;
  bool at_rest = false;
  double cpu_s = 0.0, wall_s = 0.0, contact_s = 0.0;
  std::string start;  // how the level began, in words
};

/// All that a run needs to go on as if it had not been interrupted.
struct SimulationCheckpoint {
  std::uint64_t key = 0;  // of scene and options: simulation_key
  ClothState state;
  RestPace pace;  // step_s: the next step of any method
  std::int32_t easy_steps = 0;
  std::int32_t frames = 0;  // written so far
  std::int32_t rejected_steps = 0;
  double shortest_step_s = 0.0;
  double barrier_factor = 1.0;            // on ContactLaw::barrier_pa, raised by hits at speed
  std::optional<double> over_strained_s;  // when the strain limit was passed first
  std::vector<SimulationLevel> levels;    // the last one is under way
  std::vector<SimulationRow> rows;
};

/// What came of a run.
struct SimulationSummary {
  ClothScene scene;  // of the finest level that was reached
  ClothState state;
  bool at_rest = false;
  bool stopped = false;     // on request, before its end
  double residual = 0.0;    // relative
  double residual_n = 0.0;  // root sum of squares of the vertices' unbalanced forces
  double largest_elongation = 0.0, largest_compression = 0.0;
  std::int64_t penetrations = 0;
  std::optional<DrapeProfile> drape;
  std::vector<SimulationLevel> levels;
  std::vector<SimulationRow> rows;
  std::int32_t rejected_steps = 0;
  double shortest_step_s = 0.0;
  double barrier_factor = 1.0;  // see SimulationCheckpoint
  std::optional<double> over_strained_s;
  std::int32_t frames = 0;
};

/// What a run hands out on its way.
class SimulationSink {
 public:
  virtual ~SimulationSink() = default;
  /// Scene and options have proved good: the run starts, or goes on.
  virtual void begin();
  /// Frame `number` of the motion (of a quasi-static run: after each of its steps).
  virtual void frame(int number, double time_s, const Sheet& sheet, const Points& positions_m);
  /// A level from coarse to fine is at rest, or has given up.
  virtual void level_done(int number, const SimulationLevel& level, const Sheet& sheet,
                          const Points& positions_m);
  virtual void checkpoint(const SimulationCheckpoint& checkpoint);
  virtual void warn(const std::string& message);
};

/// Names a run: a checkpoint of a run with another key cannot be resumed.
std::uint64_t simulation_key(const ClothScene& scene, const SimulationOptions& options);

/// Runs `setup`. `resume` goes on from a checkpoint, to the same result. Throws InvalidInput where
/// the cloth crosses a body at the start, where options do not fit the scene, and where the
/// checkpoint is of another run; SolverError where no step above the smallest can be solved.
/// Methods that know no time take incremental friction inside the fabric as monotone. Between
/// levels from coarse to fine, friction between surfaces starts anew.
SimulationSummary simulate(const SimulationSetup& setup, const SimulationOptions& options,
                           SimulationSink& sink, Progress& progress,
                           const SimulationCheckpoint* resume = nullptr);

}  // namespace semblance
