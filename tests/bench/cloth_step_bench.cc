// A sheet of 1.0 x 0.8 m that falls over a table, at 1 and 0.5 cm: one step of 10 ms with contact,
// its parts, and the linear solvers on its matrix.
#include <benchmark/benchmark.h>

#include <map>
#include <memory>
#include <string>

#include "cloth_fabric/plausible_fabric.h"
#include "semblance/cloth/cloth_system.h"
#include "semblance/cloth/presets.h"

namespace semblance {
namespace {

constexpr double step_s = 0.01;

/// The sheet after 0.1 s: its rims hang, its middle lies.
struct Falling {
  explicit Falling(double spacing_m)
      : system(make_preset("table", spacing_m, testing::plausible_fabric())),
        state(system.start()) {
    for (int i = 0; i < 10; ++i) system.step(state, step_s);
    system.energy().begin_step(state.positions_m, state.memory, step_s);
  }
  ClothSystem system;
  ClothState state;
};

/// Kept: a benchmark's function is called anew for every number of iterations that is tried.
Falling& falling_at(double spacing_m) {
  static std::map<double, std::unique_ptr<Falling>> all;
  std::unique_ptr<Falling>& falling = all[spacing_m];
  if (!falling) falling = std::make_unique<Falling>(spacing_m);
  return *falling;
}

/// The matrix of that step without contacts, and a load on it.
struct Matrix {
  explicit Matrix(Falling& falling)
      : assembly(falling.system.energy().deformation(),
                 static_cast<int>(falling.state.positions_m.rows()), {}) {
    Points gradient;
    falling.system.energy().hessian(falling.state.positions_m, HessianKind::convex, gradient,
                                    hessian);
    assembly.assemble(hessian, matrix);
    const Eigen::VectorXd& masses_kg = falling.system.masses_kg();
    load.setZero(4, masses_kg.size());
    for (Eigen::Index v = 0; v < masses_kg.size(); ++v) {
      const double shift = masses_kg[v] / (step_s * step_s);
      matrix.own[v] = {shift, 0.0, 0.0, shift, 0.0, shift};
      load(1, v) = -masses_kg[v] * (v % 7 == 0 ? 10.0 : 1.0);
    }
    matrix.complete();
  }
  Assembly assembly;
  StrainHessian hessian;
  BlockMatrix matrix;
  BlockVector load;
};

void whole_step(benchmark::State& state, double spacing_m) {
  Falling& falling = falling_at(spacing_m);
  int newton = 0, linear = 0, steps = 0;
  for (auto _ : state) {
    ClothState copy = falling.state;
    falling.system.contacts().update(copy.positions_m, copy.time_s);
    const StepReport report = falling.system.step(copy, step_s);
    newton += report.newton_iterations, linear += report.linear_iterations, ++steps;
  }
  falling.system.energy().begin_step(falling.state.positions_m, falling.state.memory, step_s);
  state.counters["newton"] = static_cast<double>(newton) / steps;
  state.counters["linear"] = static_cast<double>(linear) / steps;
}

void energy(benchmark::State& state, double spacing_m) {
  Falling& falling = falling_at(spacing_m);
  for (auto _ : state) {
    benchmark::DoNotOptimize(falling.system.energy().energy(falling.state.positions_m));
  }
}

void hessian(benchmark::State& state, double spacing_m) {
  Falling& falling = falling_at(spacing_m);
  Points gradient;
  StrainHessian out;
  for (auto _ : state) {
    falling.system.energy().hessian(falling.state.positions_m, HessianKind::convex, gradient, out);
  }
}

void assemble(benchmark::State& state, double spacing_m) {
  Falling& falling = falling_at(spacing_m);
  Matrix m(falling);
  for (auto _ : state) m.assembly.assemble(m.hessian, m.matrix);
}

/// From preparing to a tenth of what the solution gains.
void solve(benchmark::State& state, double spacing_m, const char* name) {
  Falling& falling = falling_at(spacing_m);
  const Matrix m(falling);
  const auto solver = make_linear_solver(name, falling.system.scene().sheet);
  LinearSolution solution;
  for (auto _ : state) {
    BlockVector x = BlockVector::Zero(4, m.load.cols());
    solver->prepare(m.matrix);
    solution = solver->solve(m.load, 0.1, x);
  }
  state.counters["iterations"] = solution.iterations;
}

void register_all() {
  for (const double spacing_m : {0.01, 0.005}) {
    const std::string size = spacing_m == 0.01 ? "/1cm" : "/0.5cm";
    const auto add = [&](const std::string& what, const auto& function) {
      benchmark::RegisterBenchmark(("cloth_step/" + what + size).c_str(), function)
          ->Unit(benchmark::kMillisecond)
          ->UseRealTime();
    };
    add("step", [=](benchmark::State& s) { whole_step(s, spacing_m); });
    add("energy", [=](benchmark::State& s) { energy(s, spacing_m); });
    add("hessian", [=](benchmark::State& s) { hessian(s, spacing_m); });
    add("assemble", [=](benchmark::State& s) { assemble(s, spacing_m); });
    for (const char* name : {"jacobi", "lines", "two-level", "direct"}) {
      add(std::string("solve_") + name, [=](benchmark::State& s) { solve(s, spacing_m, name); });
    }
  }
}

const bool registered = (register_all(), true);

}  // namespace
}  // namespace semblance
