// Every implicit step minimises
//
//     sum_i m_i |x_i - y_i|^2 / (2 h^2) + a sum_i m_i |x_i - c_i|^2 / (2 h) + E(x) + friction(x)
//
// over the positions x at its end: y is where the vertices would be without forces, c where they
// would be if they stood still, h the step times the scheme's factor, a the mass part of damping, E
// gravity, the sheet's energy and the barriers of contacts. (Martin et al., SIGGRAPH 2011; Li et
// al. 2020.) A minimum exists for every step, so steps fail only for want of accuracy.
#include "semblance/cloth/cloth_system.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

/// The barrier's pressure over the cloth's own: one layer at rest then floats at 0.9 of the reach,
/// and a hundred layers, or an edge over which it hangs, still keep a tenth of it.
constexpr double barrier_per_weight = 100.0;

class Stopwatch {
 public:
  explicit Stopwatch(double& total_s) : total_s_(total_s) {}
  ~Stopwatch() {
    total_s_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  double& total_s_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

std::vector<bool> flags(const std::vector<int>& fixed, Eigen::Index vertices) {
  std::vector<bool> out;
  if (fixed.empty()) return out;
  out.assign(vertices, false);
  for (const int v : fixed) {
    if (v < 0 || v >= vertices) {
      throw InvalidInput(fmt::format("cloth: fixed vertex {} of {}", v, vertices));
    }
    out[v] = true;
  }
  return out;
}

ContactFinder make_finder(const ClothScene& scene) {
  ContactSurface surface;
  surface.rest_positions_m.resize(scene.sheet.vertex_count(), 3);
  surface.rest_positions_m << scene.sheet.material_m,
      Eigen::VectorXd::Zero(scene.sheet.vertex_count());
  surface.triangles = scene.sheet.triangles;
  surface.vertex_area_m2 = scene.sheet.vertex_areas_m2();
  ContactOptions options;
  options.reach_m = scene.fabric.thickness_m;
  options.self_contact = scene.self_contact;
  return ContactFinder(surface, scene.obstacles, options);
}

/// Which Hessian serves the next iteration. Far from the minimum the convex one leads the surer
/// way. Once steps are short, the negative curvature that it leaves out, of yarns under pressure,
/// is what slows Newton's method down. Steps in time have inertia's curvature, and are all convex.
class HessianChoice {
 public:
  /// Iterations that go less than `short_m` are short; 0: none.
  explicit HessianChoice(double short_m) : short_m_(short_m) {}

  HessianKind kind() const {
    return !refuted_ && std::max(last_m_, before_m_) < short_m_ ? HessianKind::nearly_exact
                                                                : HessianKind::convex;
  }
  /// The last iteration went `fraction` of a way of `length_m`.
  void note(double fraction, double length_m) {
    before_m_ = last_m_;
    last_m_ = fraction == 1.0 ? length_m : too_far_m;
  }
  /// Negative curvature was met; false where another Hessian does not help.
  bool refute() {
    const bool helps = kind() != HessianKind::convex;
    refuted_ = true;
    return helps;
  }

 private:
  static constexpr double too_far_m = 1e300;
  double short_m_, last_m_ = too_far_m, before_m_ = too_far_m;
  bool refuted_ = false;
};

}  // namespace

struct ClothSystem::Step {
  double step_s = 0.0;
  double inertia = 0.0;    // 1 / h^2
  double drag = 0.0;       // a / h
  Points inertial, still;  // y and c
  FrictionStep friction;
};

ClothSystem::ClothSystem(ClothScene scene, const StepOptions& options)
    : scene_(std::move(scene)),
      options_(options),
      masses_kg_(scene_.sheet.vertex_areas_m2() * scene_.fabric.area_density_kg_m2),
      fixed_(flags(scene_.fixed, scene_.sheet.vertex_count())),
      energy_(scene_.sheet, scene_.fabric, scene_.model, fixed_),
      assembly_(energy_.deformation(), static_cast<int>(scene_.sheet.vertex_count()), fixed_),
      finder_(make_finder(scene_)),
      solver_(make_linear_solver(options.linear_solver, scene_.sheet)) {
  moving_ = std::any_of(scene_.obstacles.begin(), scene_.obstacles.end(), is_moving);
  law_.friction = scene_.fabric.friction;
  law_.barrier_pa = barrier_per_weight * scene_.fabric.area_density_kg_m2 *
                    std::max(scene_.gravity_m_s2.norm(), 1.0);
}

ClothSystem::~ClothSystem() = default;

ClothState ClothSystem::start() {
  ClothState state;
  state.positions_m = scene_.start_m;
  state.velocities_m_s = Points::Zero(scene_.start_m.rows(), 3);
  Points rest(scene_.sheet.vertex_count(), 3);
  rest << scene_.sheet.material_m, Eigen::VectorXd::Zero(scene_.sheet.vertex_count());
  state.memory = energy_.memory_at(rest);
  state.friction = scene_.start_friction;
  finder_.update(state.positions_m, 0.0);
  return state;
}

double ClothSystem::weight_norm() const {
  // Without gravity forces are compared with the weight on Earth.
  const double gravity = scene_.gravity_m_s2.norm();
  return masses_kg_.norm() * (gravity > 0.0 ? gravity : 9.80665);
}

/// The matrix of the strains' second derivatives and of inertia; contacts are to be added.
void ClothSystem::assemble(const Step& step) {
  const Stopwatch watch(timing_.assembly_s);
  assembly_.assemble(strain_hessian_, matrix_);
  for (Eigen::Index v = 0; v < masses_kg_.size(); ++v) {
    if (assembly_.is_fixed(static_cast<int>(v))) continue;
    const double shift = masses_kg_[v] * (step.inertia + step.drag);
    for (const int k : {0, 3, 5}) matrix_.own[v][k] += shift;
  }
}

double ClothSystem::add_contacts(const Step& step, const Points& x, Points& gradient,
                                 BlockMatrix* matrix) {
  const Stopwatch watch(timing_.contact_s);
  return add_barriers(finder_.contacts(x), law_, &gradient, matrix) +
         step.friction.add_gradient(x, gradient, matrix);
}

/// Energy and gradient; with a kind of Hessian, `matrix_` too.
double ClothSystem::derivatives(const Step& step, const Points& x, Points& gradient,
                                std::optional<HessianKind> hessian) {
  double value = 0.0;
  {
    const Stopwatch watch(timing_.energy_s);
    value = hessian ? energy_.hessian(x, *hessian, gradient, strain_hessian_)
                    : energy_.gradient(x, gradient);
  }
  if (hessian) assemble(step);
  value += add_contacts(step, x, gradient, hessian ? &matrix_ : nullptr);
  for (Eigen::Index v = 0; v < x.rows(); ++v) {
    const Eigen::RowVector3d from_y = x.row(v) - step.inertial.row(v);
    const Eigen::RowVector3d from_c = x.row(v) - step.still.row(v);
    value += masses_kg_[v] *
             (0.5 * step.inertia * from_y.squaredNorm() + 0.5 * step.drag * from_c.squaredNorm() -
              scene_.gravity_m_s2.dot(x.row(v)));
    gradient.row(v) += masses_kg_[v] * (step.inertia * from_y + step.drag * from_c -
                                        scene_.gravity_m_s2.transpose());
    if (assembly_.is_fixed(static_cast<int>(v))) gradient.row(v).setZero();
  }
  return value;
}

double ClothSystem::value(const Step& step, const Points& x) {
  double value = 0.0;
  {
    const Stopwatch watch(timing_.energy_s);
    value = energy_.energy(x);
  }
  {
    const Stopwatch watch(timing_.contact_s);
    value += add_barriers(finder_.contacts(x), law_, nullptr, nullptr);
    value += step.friction.energy(x);
  }
  for (Eigen::Index v = 0; v < x.rows(); ++v) {
    value += masses_kg_[v] * (0.5 * step.inertia * (x.row(v) - step.inertial.row(v)).squaredNorm() +
                              0.5 * step.drag * (x.row(v) - step.still.row(v)).squaredNorm() -
                              scene_.gravity_m_s2.dot(x.row(v)));
  }
  return value;
}

/// sum m |dv|^2 with dv the change of velocity, J; of a quasi-static step the velocity itself.
double ClothSystem::change_of_motion(const Step& step, const Points& x) const {
  double sum = 0.0;
  for (Eigen::Index v = 0; v < x.rows(); ++v) {
    if (assembly_.is_fixed(static_cast<int>(v))) continue;
    sum += masses_kg_[v] * (x.row(v) - step.inertial.row(v)).squaredNorm();
  }
  return step.inertia * sum;
}

/// Goes on as with the accelerations of the last step, as far as contacts let it and if that is
/// better than to stand still: what slides goes on to slide, which saves finding that out.
void ClothSystem::predict(const Step& step, const ClothState& state, Points& x) {
  const double before = value(step, x);
  Points way = step.inertial - x;
  if (state.previous_step_s > 0.0) {
    way += step.step_s * step.step_s / state.previous_step_s *
           (state.velocities_m_s - state.previous_velocities_m_s);
  }
  Points ahead;
  {
    const Stopwatch watch(timing_.contact_s);
    ahead = x + finder_.max_step(x, way) * way;
    finder_.update(ahead);
  }
  if (value(step, ahead) < before) {
    x.swap(ahead);
  } else {
    const Stopwatch watch(timing_.contact_s);
    finder_.update(x);
  }
}

/// Solves matrix_ change = -gradient.
LinearSolution ClothSystem::solve_linear(const Points& gradient, Points& change) {
  const Stopwatch watch(timing_.linear_s);
  matrix_.complete();
  BlockVector b(4, gradient.rows()), p = BlockVector::Zero(4, gradient.rows());
  b << -gradient.transpose(), Eigen::RowVectorXd::Zero(gradient.rows());
  solver_->prepare(matrix_);
  const LinearSolution solution = solver_->solve(b, options_.linear_tolerance, p);
  change = p.topRows<3>().transpose();
  return solution;
}

/// Yarns that turn get longer on a straight way, and that costs more energy than most steps gain.
/// Returns `ahead` with their lengths as the way foresaw them to first order, as far as contacts
/// allow: the second-order correction of constrained optimisation (Nocedal and Wright 2006, 15.6),
/// with stiff yarns for constraints.
Points ClothSystem::keep_lengths(const Step& step, const Points& x, const Points& ahead,
                                 StepReport& report) {
  Points gradient, change, unused = Points::Zero(x.rows(), 3);
  {
    const Stopwatch watch(timing_.energy_s);
    energy_.resist_lengthening(x, ahead, gradient, strain_hessian_);
  }
  assemble(step);
  add_contacts(step, ahead, unused, &matrix_);
  for (const int v : scene_.fixed) gradient.row(v).setZero();
  report.linear_iterations += solve_linear(gradient, change).iterations;
  const Stopwatch watch(timing_.contact_s);
  const Points way = ahead + change - x;
  finder_.update(x);
  Points out = x + finder_.max_step(x, way) * way;
  finder_.update(out);
  return out;
}

/// Moves `x` along `direction` to where the energy, `current` at the start, is lower, and returns
/// by which fraction of it; 0 where there is no such place.
double ClothSystem::search(const Step& step, double current, double slope, const Points& direction,
                           Points& x, StepReport& report) {
  // Shorter ways turn yarns little, as do steps in time.
  const double shortest_kept = options_.scheme == TimeScheme::quasistatic ? 0.2 : 2.0;
  // Near the minimum energies cannot tell better from worse.
  const double rounding = 1e-13 * std::abs(current);
  double fraction = 1.0;
  {
    const Stopwatch watch(timing_.contact_s);
    fraction = finder_.max_step(x, direction);
  }
  const auto is_lower = [&](const Points& trial) {
    return value(step, trial) <= current + 1e-4 * fraction * slope + rounding;
  };
  for (;;) {
    Points trial = x + fraction * direction;
    {
      const Stopwatch watch(timing_.contact_s);
      finder_.update(trial);
    }
    bool found = is_lower(trial);
    if (!found && fraction >= shortest_kept) {
      trial = keep_lengths(step, x, trial, report);
      found = is_lower(trial);
    }
    if (found) {
      x.swap(trial);
      return fraction;
    }
    fraction *= 0.5;
    if (fraction < 1e-6) {
      finder_.update(x);
      return 0.0;
    }
  }
}

StepReport ClothSystem::solve(Step& step, Points& x) {
  StepReport report;
  Points gradient, direction;
  const double weight = weight_norm();
  const double spacing_m = std::sqrt(masses_kg_.mean() / scene_.fabric.area_density_kg_m2);
  HessianChoice choice(options_.scheme == TimeScheme::quasistatic ? 0.1 * spacing_m : 0.0);
  for (;;) {
    const double current = derivatives(step, x, gradient, choice.kind());
    report.residual = gradient.norm() / weight;
    if (report.residual <= options_.tolerance) {
      report.solved = true;
      return report;
    }
    if (report.newton_iterations == options_.most_newton_iterations) return report;
    const LinearSolution solution = solve_linear(gradient, direction);
    report.linear_iterations += solution.iterations;
    if (solution.negative_curvature && choice.refute()) continue;
    ++report.newton_iterations;
    const double slope = gradient.cwiseProduct(direction).sum();
    if (!(slope < 0.0)) return report;
    // p'Hp = -slope, and H is at least that of the kinetic energy.
    const bool last = -slope <= std::pow(options_.motion_tolerance, 2) * change_of_motion(step, x);
    const double fraction = search(step, current, slope, direction, x, report);
    if (fraction == 0.0) return report;
    if (last && fraction == 1.0) {
      report.solved = true;
      return report;
    }
    choice.note(fraction, direction.rowwise().norm().maxCoeff());
  }
}

/// Bodies go as far as the gaps allow and push the cloth out of their way, again and again, until
/// they are where the step ends.
StepReport ClothSystem::solve_among_moving(Step& step, double end_s, Points& x) {
  constexpr int most_moves = 200;
  const Points still = Points::Zero(x.rows(), 3);
  StepReport sum;
  for (int move = 0; move < most_moves; ++move) {
    double fraction = 0.0;
    {
      const Stopwatch watch(timing_.contact_s);
      fraction = finder_.max_step_until(x, still, end_s);
      finder_.move_obstacles(end_s, fraction);
      finder_.update(x);
    }
    const StepReport report = solve(step, x);
    sum.newton_iterations += report.newton_iterations;
    sum.linear_iterations += report.linear_iterations;
    sum.residual = report.residual;
    sum.solved = report.solved && fraction == 1.0;
    if (!report.solved || fraction == 1.0) break;
  }
  return sum;
}

/// Forces at the start, where friction of the last step still holds, and viscosity, which knows no
/// rate there, is zero. Not solved where the way is not clear.
StepReport ClothSystem::step_explicitly(ClothState& state, double step_s) {
  Step step;
  step.inertial = step.still = state.positions_m;
  energy_.begin_step(state.positions_m, state.memory, std::numeric_limits<double>::infinity());
  step.friction = FrictionStep(finder_.contacts(state.positions_m), state.positions_m, step_s, law_,
                               state.friction);
  Points gradient;
  derivatives(step, state.positions_m, gradient, std::nullopt);
  const double drag = 1.0 / (1.0 + step_s * scene_.fabric.mass_damping_1_s);
  for (Eigen::Index v = 0; v < gradient.rows(); ++v) {
    state.velocities_m_s.row(v) =
        drag * (state.velocities_m_s.row(v) - step_s / masses_kg_[v] * gradient.row(v));
  }
  const Points displacement = step_s * state.velocities_m_s;
  StepReport report;
  report.residual = gradient.norm() / weight_norm();
  if (!displacement.allFinite()) return report;
  const Stopwatch watch(timing_.contact_s);
  const double end_s = state.time_s + step_s;
  report.solved = finder_.max_step_until(state.positions_m, displacement, end_s) == 1.0;
  if (!report.solved) return report;
  state.positions_m += displacement;
  finder_.update(state.positions_m, end_s);
  energy_.end_step(state.positions_m, state.memory);
  state.friction = step.friction.memory(state.positions_m);
  state.time_s += step_s;
  return report;
}

StepReport ClothSystem::step(ClothState& state, double step_s) {
  const Stopwatch watch(timing_.total_s);
  if (options_.scheme == TimeScheme::explicit_euler) return step_explicitly(state, step_s);
  Step step;
  step.step_s = step_s;
  const bool still = options_.scheme == TimeScheme::quasistatic;
  double h = step_s;
  step.still = state.positions_m;
  step.inertial = state.positions_m;
  if (options_.scheme == TimeScheme::bdf2 && state.previous_step_s > 0.0) {
    // Variable-step BDF2: x1 = a x0 + b x-1 + h v1, the same for v.
    const double ratio = step_s / state.previous_step_s;
    const double a = (1.0 + ratio) * (1.0 + ratio) / (1.0 + 2.0 * ratio);
    const double b = -ratio * ratio / (1.0 + 2.0 * ratio);
    h = step_s * (1.0 + ratio) / (1.0 + 2.0 * ratio);
    step.still = a * state.positions_m + b * state.previous_positions_m;
    step.inertial = step.still + h * (a * state.velocities_m_s + b * state.previous_velocities_m_s);
  } else if (!still) {
    step.inertial += h * state.velocities_m_s;
  }
  step.inertia = 1.0 / (h * h);
  step.drag = still ? 0.0 : scene_.fabric.mass_damping_1_s / h;
  const double loss_step_s = still ? std::numeric_limits<double>::infinity() : step_s;
  energy_.begin_step(state.positions_m, state.memory, loss_step_s);
  step.friction = FrictionStep(finder_.contacts(state.positions_m), state.positions_m, loss_step_s,
                               law_, state.friction);
  Points x = state.positions_m;
  // Gaps that a prediction used up would stop bodies that come.
  if (!still && !moving_) predict(step, state, x);
  const StepReport report =
      moving_ ? solve_among_moving(step, state.time_s + step_s, x) : solve(step, x);
  state.previous_positions_m = std::move(state.positions_m);
  state.previous_velocities_m_s = state.velocities_m_s;
  state.previous_step_s = step_s;
  state.velocities_m_s = (x - step.still) / h;
  energy_.end_step(x, state.memory);
  state.friction = step.friction.memory(x);
  state.positions_m = std::move(x);
  state.time_s += step_s;
  return report;
}

double ClothSystem::rest_residual(const ClothState& state) {
  Step step;
  step.inertial = step.still = state.positions_m;
  energy_.begin_step(state.positions_m, state.memory, std::numeric_limits<double>::infinity());
  step.friction = FrictionStep(finder_.contacts(state.positions_m), state.positions_m,
                               std::numeric_limits<double>::infinity(), law_, state.friction);
  Points gradient;
  derivatives(step, state.positions_m, gradient, std::nullopt);
  return gradient.norm() / weight_norm();
}

ClothEnergies ClothSystem::energies(const ClothState& state) {
  ClothEnergies out;
  energy_.begin_elastic();
  out.elastic_j = energy_.energy(state.positions_m);
  out.contact_j = add_barriers(finder_.contacts(state.positions_m), law_, nullptr, nullptr);
  out.kinetic_j = 0.5 * masses_kg_.dot(state.velocities_m_s.rowwise().squaredNorm());
  out.gravity_j = -masses_kg_.dot(state.positions_m * scene_.gravity_m_s2);
  return out;
}

}  // namespace semblance
