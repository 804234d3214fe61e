// What every Cost must satisfy, as a function that the test of a new cost can call. It needs no
// test framework; the macro at the end is for GoogleTest.
#pragma once

#include <functional>
#include <limits>
#include <span>
#include <string>

#include "semblance/cost/cost.h"

namespace semblance {

/// Calls `use` with the synthesis at x.
using SynthesisAt =
    std::function<void(const Eigen::VectorXd& x, const std::function<void(const Synthesis&)>& use)>;

struct CostAccuracy {
  /// Difference allowed between gradient and central differences of the cost, relative to the
  /// gradient's norm, all in units of the differences' steps. Infinite: the cost's gradient is that
  /// of another function near this one, and is not compared.
  double gradient = 1e-3;
  /// A step moves no vertex further in the image, and is at most a hundredth of tangent_scale().
  double step_px = 0.1;
};

/// One line for each broken promise at the given points, empty if there is none. Checked: name and
/// unit are given; the cost is finite, not negative, and the same bits in repeated calls, in calls
/// from several threads, and with or without derivatives being asked for (to 1e-5 there); the
/// gradient equals central differences, where the motion of the surface's image is itself taken
/// from differences of the synthesis; the Hessian is positive semidefinite.
std::string cost_contract_violations(const Cost& cost, const SurfaceTopology& topology,
                                     const ParameterSpace& space, const SynthesisAt& synthesis_at,
                                     std::span<const Eigen::VectorXd> points,
                                     const CostAccuracy& accuracy);

}  // namespace semblance

#define EXPECT_COST_CONTRACT(cost, topology, space, synthesis_at, points, accuracy)                \
  EXPECT_EQ("", ::semblance::cost_contract_violations(cost, topology, space, synthesis_at, points, \
                                                      accuracy))
