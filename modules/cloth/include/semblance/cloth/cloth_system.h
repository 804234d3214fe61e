// A sheet of fabric among obstacles, and its motion.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "semblance/cloth/assembly.h"
#include "semblance/cloth/contact.h"
#include "semblance/cloth/contact_force.h"
#include "semblance/cloth/linear_solver.h"
#include "semblance/cloth/sheet_energy.h"

namespace semblance {

/// What is simulated.
struct ClothScene {
  Sheet sheet;
  Fabric fabric;
  SheetModel model;
  Points start_m;  // positions at the start
  /// Of an earlier rest of the same sheet: friction's springs, and how many times stronger barriers
  /// had become. Without them cloth that rests by friction has to find its rest anew.
  FrictionMemory start_friction;
  double start_barrier_factor = 1.0;
  std::vector<int> fixed;  // vertices that are held where they are
  std::vector<Obstacle> obstacles;
  bool self_contact = true;
  Eigen::Vector3d gravity_m_s2 = {0.0, -9.80665, 0.0};
};

/// Everything that later steps depend on.
struct ClothState {
  double time_s = 0.0;
  Points positions_m, velocities_m_s;
  Points previous_positions_m, previous_velocities_m_s;  // one step back, for BDF2; may be empty
  double previous_step_s = 0.0;
  SheetMemory memory;
  FrictionMemory friction;
};

enum class TimeScheme {
  explicit_euler,  // symplectic: velocities first; steps below the stability limit; no viscosity
  implicit_euler,
  bdf2,         // variable steps; its first step is implicit Euler's
  quasistatic,  // implicit Euler from standstill: no step keeps a velocity
};

/// How steps are solved.
struct StepOptions {
  TimeScheme scheme = TimeScheme::implicit_euler;
  std::string linear_solver = "lines";
  double linear_tolerance = 0.3;
  /// A step is solved when the forces that are left are below this fraction of the weight (both
  /// root sums of squares over the vertices) ...
  double tolerance = 1e-3;
  /// ... or when what Newton's method still changes is, in the norm of the kinetic energy, below
  /// this fraction of the change of velocity in the step (quasistatic: of the way of the step).
  double motion_tolerance = 0.2;
  int most_newton_iterations = 30;
};

/// What a step did.
struct StepReport {
  bool solved = false;
  int newton_iterations = 0;
  int linear_iterations = 0;
  double residual = 0.0;  // as StepOptions::tolerance
};

/// Where time went, in seconds of the wall clock.
struct ClothTiming {
  double total_s = 0.0, contact_s = 0.0, energy_s = 0.0, assembly_s = 0.0, linear_s = 0.0;
};

/// Energies of a state in joule. Elastic is what the sheet would give back: without the work that
/// friction and viscosity took.
struct ClothEnergies {
  double kinetic_j = 0.0, elastic_j = 0.0, gravity_j = 0.0, contact_j = 0.0;
};

/// Steps a ClothState. Every implicit step minimises its incremental potential by Newton's method
/// with line search; see cloth_system.cc.
class ClothSystem {
 public:
  /// Throws InvalidInput where the scene cannot be simulated.
  explicit ClothSystem(ClothScene scene, const StepOptions& options = {});
  ~ClothSystem();

  const ClothScene& scene() const { return scene_; }
  const Eigen::VectorXd& masses_kg() const { return masses_kg_; }
  SheetEnergy& energy() { return energy_; }
  ContactFinder& contacts() { return finder_; }
  const ClothTiming& timing() const { return timing_; }
  StepOptions& options() { return options_; }
  ContactLaw& contact_law() { return law_; }

  ClothState start();
  StepReport step(ClothState& state, double step_s);

  /// Forces that are not balanced at rest, over the weight (root sums of squares), with the
  /// friction that the state remembers.
  double rest_residual(const ClothState& state);
  /// What residuals are relative to: the root sum of squares of the vertices' weights, N.
  double weight_norm() const;
  ClothEnergies energies(const ClothState& state);

 private:
  struct Step;
  StepReport step_explicitly(ClothState& state, double step_s);
  void predict(const Step& step, const ClothState& state, Points& x);
  StepReport solve(Step& step, Points& x);
  StepReport solve_among_moving(Step& step, double end_s, Points& x);
  double change_of_motion(const Step& step, const Points& x) const;
  double value(const Step& step, const Points& x);
  double derivatives(const Step& step, const Points& x, Points& gradient,
                     std::optional<HessianKind> hessian);
  double add_contacts(const Step& step, const Points& x, Points& gradient, BlockMatrix* matrix);
  void assemble(const Step& step);
  LinearSolution solve_linear(const Points& gradient, Points& change);
  Points keep_lengths(const Step& step, const Points& x, const Points& ahead, StepReport& report);
  double search(const Step& step, double current, double slope, const Points& direction, Points& x,
                StepReport& report);

  ClothScene scene_;
  StepOptions options_;
  Eigen::VectorXd masses_kg_;
  std::vector<bool> fixed_;
  bool moving_ = false;  // any obstacle
  SheetEnergy energy_;
  Assembly assembly_;
  ContactFinder finder_;
  ContactLaw law_;
  std::unique_ptr<LinearSolver> solver_;
  BlockMatrix matrix_;
  StrainHessian strain_hessian_;
  ClothTiming timing_;
};

}  // namespace semblance
