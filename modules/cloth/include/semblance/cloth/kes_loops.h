// KES tests of a specimen, real or virtual: the loops they record and the figures read off them.
#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "semblance/cloth/fabric.h"
#include "semblance/cloth/kes.h"

namespace semblance {

/// One reading, in the units of ModeResponse.
struct LoopSample {
  double deformation = 0.0, force = 0.0;
};
/// In the order of time: from rest at 0 to the positive turn, back, and where the test does so on
/// to the negative turn and back to 0.
using Loop = std::vector<LoopSample>;

/// The loops of one fabric; an empty one was not recorded.
struct KesLoops {
  std::array<Loop, 2> tension, bending;  ///< by Direction
  Loop shear, bending_bias;
};

/// Kawabata's figures as far as the loops go: a figure whose place was not reached is left out.
/// Shear and bending are the means of both sides where both were recorded.
KesFigures figures_of(const KesLoops& loops);

/// Brings a specimen slowly to a deformation and returns its force per width, or moment per width:
/// in the units of ModeResponse. It remembers where it was.
using Specimen = std::function<double(double deformation)>;

/// Steps from rest to a turn: 320 put a dozen of them into the turn of friction.
struct TestPlan {
  int steps = 320;
};

/// Pulls until the force is 500 gf/cm and lets go until it is 0. Throws SolverError where the
/// specimen does not reach that force below a strain of 3, or where its force is not finite.
Loop run_tension_test(const Specimen& specimen, const TestPlan& plan = {});
/// To +8 deg, -8 deg, and back to 0.
Loop run_shear_test(const Specimen& specimen, const TestPlan& plan = {});
/// To +2.5 1/cm, -2.5 1/cm, and back to 0.
Loop run_bending_test(const Specimen& specimen, const TestPlan& plan = {});

/// One fresh specimen for each test.
struct Specimens {
  std::array<Specimen, 2> tension, bending;  ///< by Direction
  Specimen shear;
};
KesLoops run_kes_tests(const Specimens& specimens, const TestPlan& plan = {});

/// ModeResponse's own law, without a sheet around it: what a sheet is compared with.
Specimen material_point(const ModeResponse& response);
/// Material points of all modes.
Specimens material_points(const Fabric& fabric);

/// The steady branches elastic +- friction of all modes, as far as the tests go and the curves were
/// measured.
KesLoops steady_loops(const Fabric& fabric);

/// A figure as given and as a test gave it.
struct FigureComparison {
  FigureName name{};
  std::optional<double> given;
  double reproduced = 0.0;
  /// Nothing where there is no figure to compare with, or it is 0.
  std::optional<double> residual_pct() const;
};
/// All figures that were reproduced, in the order of tables.
std::vector<FigureComparison> compare_figures(const KesFigures& given,
                                              const KesFigures& reproduced);

}  // namespace semblance
