// The shape in which a sheet stays.
#pragma once

#include <functional>
#include <optional>

#include "semblance/cloth/cloth_system.h"
#include "semblance/core/progress.h"

namespace semblance {

/// How the approach to rest goes on: with the state, all that an interrupted one needs.
struct RestPace {
  double step_s = 0.0;     // of the next step
  double tolerance = 0.0;  // StepOptions::tolerance of the next step
};

struct RestReport {
  bool at_rest = false;
  bool step_solved = false;  // the last one
  int steps = 0;
  int newton_iterations = 0;
  int linear_iterations = 0;
  double residual = 0.0;
};

/// Rest is where forces balance, with the friction that held on the way: no step moves the sheet
/// any more. It is approached by quasi-static steps (each the implicit Euler step of a sheet
/// without velocity, so every one lowers the energy) that grow while they are easy.
struct RestOptions {
  double tolerance = 1e-3;  // of the unbalanced forces over the weight
  double first_step_s = 0.03;
  double longest_step_s = 3.0;
  int most_steps = 2000;
  /// StepOptions of every step: on the way to rest rough solutions serve, and steps need not be
  /// solved.
  double linear_tolerance = 0.1;
  double motion_tolerance = 0.1;
  int most_newton_iterations = 40;
  /// Goes on with this pace, where an earlier call was interrupted.
  std::optional<RestPace> pace;
  /// Called after every step, with what the next one starts from.
  std::function<void(const ClothState&, const RestReport&, const RestPace&)> after_step;
};

/// Brings `state` to rest. `system`'s scheme must be quasistatic; its other options are set.
RestReport settle(ClothSystem& system, ClothState& state, const RestOptions& options,
                  Progress& progress);

/// Positions of `fine` on the surface that `coarse` forms at `positions_m`, triangle by triangle:
/// what did not cross before does not cross now.
Points refine(const Sheet& coarse, const Points& positions_m, const Sheet& fine);

}  // namespace semblance
