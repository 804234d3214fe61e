#include "semblance/cloth/kes_loops.h"

#include <fmt/format.h>

#include <cmath>
#include <span>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

using Figure = KesFigures::Figure;
using Branch = std::span<const LoopSample>;

/// Loading and unloading of one side; the samples of the negative side have both signs turned.
struct Side {
  Loop loading, unloading;
};

Loop mirrored(Branch branch) {
  Loop loop(branch.begin(), branch.end());
  for (LoopSample& sample : loop) sample = {-sample.deformation, -sample.force};
  return loop;
}

std::vector<Side> sides_of(const Loop& loop) {
  const auto less = [](const LoopSample& a, const LoopSample& b) {
    return a.deformation < b.deformation;
  };
  const auto top = std::max_element(loop.begin(), loop.end(), less);
  const auto bottom = std::min_element(top, loop.end(), less);
  if (loop.empty()) return {};
  std::vector<Side> sides{{Loop(loop.begin(), top + 1), Loop(top, bottom + 1)}};
  if (bottom->deformation < 0.0 && bottom + 1 != loop.end()) {
    sides.push_back({mirrored(Branch(top, bottom + 1)), mirrored(Branch(bottom, loop.end()))});
  }
  return sides;
}

/// Linear between the first two samples around the deformation.
Figure force_at(Branch branch, double deformation) {
  for (std::size_t i = 1; i < branch.size(); ++i) {
    const LoopSample &a = branch[i - 1], &b = branch[i];
    const bool between = (a.deformation - deformation) * (b.deformation - deformation) <= 0.0;
    if (!between || a.deformation == b.deformation) continue;
    const double t = (deformation - a.deformation) / (b.deformation - a.deformation);
    return a.force + t * (b.force - a.force);
  }
  return std::nullopt;
}

/// The mean slope of a curve is that of its chord.
Figure slope_between(Branch branch, double from, double to) {
  const Figure a = force_at(branch, from), b = force_at(branch, to);
  if (!a || !b) return std::nullopt;
  return (*b - *a) / (to - from);
}

Figure width_at(const Side& side, double deformation) {
  const Figure up = force_at(side.loading, deformation),
               down = force_at(side.unloading, deformation);
  if (!up || !down) return std::nullopt;
  return *up - *down;
}

/// Mean of what was found on the sides, in another unit.
template <class Measure>
Figure mean_over(const std::vector<Side>& sides, double unit, const Measure& measure) {
  double sum = 0.0;
  int count = 0;
  for (const Side& side : sides) {
    const Figure value = measure(side);
    if (!value) continue;
    sum += *value;
    ++count;
  }
  if (count == 0) return std::nullopt;
  return sum / count / unit;
}

/// Where the branch crosses a force, or ends within a thousandth of it.
Figure deformation_at(Branch branch, double force) {
  for (std::size_t i = 1; i < branch.size(); ++i) {
    const LoopSample &a = branch[i - 1], &b = branch[i];
    if (a.force > force || b.force < force || a.force == b.force) continue;
    return a.deformation +
           (force - a.force) / (b.force - a.force) * (b.deformation - a.deformation);
  }
  if (!branch.empty() && branch.back().force > 0.999 * force) return branch.back().deformation;
  return std::nullopt;
}

/// Work up to a deformation, or from it: trapezoids of what is below it, where the cloth pulls.
double work(Branch branch, double end) {
  double sum = 0.0;
  for (std::size_t i = 1; i < branch.size(); ++i) {
    LoopSample a = branch[i - 1], b = branch[i];
    if (a.deformation > b.deformation) std::swap(a, b);
    if (a.deformation >= end || a.deformation == b.deformation) continue;
    if (b.deformation > end) b = {end, *force_at(branch.subspan(i - 1, 2), end)};
    sum +=
        0.5 * (std::max(0.0, a.force) + std::max(0.0, b.force)) * (b.deformation - a.deformation);
  }
  return sum;
}

KesFigures::Tension tension_figures(const Loop& loop) {
  KesFigures::Tension figures;
  const std::vector<Side> sides = sides_of(loop);
  if (sides.empty()) return figures;
  const Figure end = deformation_at(sides[0].loading, kes::tension_end_n_m);
  if (!end || !(*end > 0.0)) return figures;
  const double up = work(sides[0].loading, *end), down = work(sides[0].unloading, *end);
  figures.emt_pct = *end / kes::strain_from_pct;
  figures.wt_gf_cm_cm2 = up / kes::j_m2_from_gf_cm_cm2;
  figures.lt = up / (0.5 * kes::tension_end_n_m * *end);
  if (sides[0].unloading.size() > 1) figures.rt_pct = 100.0 * down / up;
  return figures;
}

KesFigures::Shear shear_figures(const Loop& loop) {
  const std::vector<Side> sides = sides_of(loop);
  constexpr double deg = kes::rad_from_deg;
  const auto slope = [](const Side& side) {
    return slope_between(side.loading, 0.5 * deg, 2.5 * deg);
  };
  const auto width = [](double angle) {
    return [angle](const Side& side) { return width_at(side, angle); };
  };
  return {mean_over(sides, kes::n_m_rad_from_gf_cm_deg, slope),
          mean_over(sides, kes::n_m_from_gf_cm, width(0.5 * deg)),
          mean_over(sides, kes::n_m_from_gf_cm, width(5.0 * deg))};
}

KesFigures::Bending bending_figures(const Loop& loop) {
  const std::vector<Side> sides = sides_of(loop);
  constexpr double per_cm = kes::per_m_from_per_cm;
  const auto slope = [](const Side& side) {
    return slope_between(side.loading, 0.5 * per_cm, 1.5 * per_cm);
  };
  const auto width = [](const Side& side) { return width_at(side, per_cm); };
  return {mean_over(sides, kes::n_m_from_gf_cm2_cm, slope),
          mean_over(sides, kes::n_from_gf_cm_cm, width)};
}

double force_of(const Specimen& specimen, double deformation, const char* test) {
  const double force = specimen(deformation);
  if (!std::isfinite(force)) {
    throw SolverError(fmt::format("{} test: the force at a deformation of {:g} is not finite", test,
                                  deformation));
  }
  return force;
}

/// Appends `steps` even steps to `end`.
void drive(const Specimen& specimen, Loop& loop, double end, int steps, const char* test) {
  const double start = loop.back().deformation;
  for (int i = 1; i <= steps; ++i) {
    const double deformation = start + (end - start) * i / steps;
    loop.push_back({deformation, force_of(specimen, deformation, test)});
  }
}

Loop run_cycle(const Specimen& specimen, double end, int steps, const char* test) {
  Loop loop{{0.0, force_of(specimen, 0.0, test)}};
  drive(specimen, loop, end, steps, test);
  drive(specimen, loop, 0.0, steps, test);
  drive(specimen, loop, -end, steps, test);
  drive(specimen, loop, 0.0, steps, test);
  return loop;
}

constexpr double k_first_strain = 1e-4;

/// The strain is driven, and the force is what the test goes to: the next step is the one that
/// would raise it evenly if the last step's stiffness held.
double next_step(const Loop& loop, int steps) {
  const LoopSample &a = loop[loop.size() - 2], &b = loop.back();
  // A toe of little force and much strain is resolved by strain.
  const double longest = std::max(k_first_strain, 10.0 / steps * b.deformation);
  const double wanted = std::min(kes::tension_end_n_m / steps, kes::tension_end_n_m - b.force);
  const double stiffness = (b.force - a.force) / (b.deformation - a.deformation);
  return stiffness > 0.0 ? std::clamp(wanted / stiffness, 1e-9, longest) : longest;
}

/// The steady branch elastic + sign * friction from one deformation to another.
void append_branch(Loop& loop, const ModeResponse& mode, double from, double to, double sign) {
  constexpr int steps = 200;
  for (int i = 0; i <= steps; ++i) {
    const double e = from + (to - from) * i / steps;
    const double elastic = std::copysign(mode.elastic.value(std::abs(e)), e);
    loop.push_back({e, elastic + sign * mode.friction.value(std::abs(e))});
  }
}

/// As far as the test goes and the fabric was measured.
Loop steady_cycle(const ModeResponse& mode, double test_end) {
  const double end = std::min(test_end, mode.elastic.last());
  Loop loop;
  append_branch(loop, mode, 0.0, end, 1.0);
  append_branch(loop, mode, end, 0.0, -1.0);
  append_branch(loop, mode, 0.0, -end, -1.0);
  append_branch(loop, mode, -end, 0.0, 1.0);
  return loop;
}

Loop steady_pull(const ModeResponse& mode) {
  const auto force = [&](double e) { return mode.elastic.value(e) + mode.friction.value(e); };
  double low = 0.0, high = mode.elastic.last();
  for (int i = 0; i < 60 && force(mode.elastic.last()) > kes::tension_end_n_m; ++i) {
    const double middle = 0.5 * (low + high);
    (force(middle) < kes::tension_end_n_m ? low : high) = middle;
  }
  Loop loop;
  append_branch(loop, mode, 0.0, high, 1.0);
  append_branch(loop, mode, high, 0.0, -1.0);
  return loop;
}

}  // namespace

KesFigures figures_of(const KesLoops& loops) {
  KesFigures figures;
  for (const std::size_t d : {warp, weft}) {
    figures.tension[d] = tension_figures(loops.tension[d]);
    figures.bending[d] = bending_figures(loops.bending[d]);
  }
  figures.shear = shear_figures(loops.shear);
  return figures;
}

Loop run_tension_test(const Specimen& specimen, const TestPlan& plan) {
  constexpr double most_strain = 3.0;
  Loop loop{{0.0, force_of(specimen, 0.0, "tension")}};
  for (double step = k_first_strain; loop.back().force < (1.0 - 1e-4) * kes::tension_end_n_m;) {
    const double strain = loop.back().deformation + step;
    if (strain > most_strain || loop.size() > 1000 * static_cast<std::size_t>(plan.steps)) {
      throw SolverError(fmt::format(
          "tension test: pulled to a strain of {:g} the specimen takes {:g} N/m; {:g} N/m (500 "
          "gf/cm) was expected before",
          loop.back().deformation, loop.back().force, kes::tension_end_n_m));
    }
    loop.push_back({strain, force_of(specimen, strain, "tension")});
    step = next_step(loop, plan.steps);
  }
  for (std::size_t i = loop.size() - 1; i > 0 && loop.back().force > 0.0; --i) {
    const double strain = loop[i - 1].deformation;
    loop.push_back({strain, force_of(specimen, strain, "tension")});
  }
  return loop;
}

Loop run_shear_test(const Specimen& specimen, const TestPlan& plan) {
  return run_cycle(specimen, kes::shear_end_rad, plan.steps, "shear");
}

Loop run_bending_test(const Specimen& specimen, const TestPlan& plan) {
  return run_cycle(specimen, kes::bending_end_1_m, plan.steps, "bending");
}

KesLoops run_kes_tests(const Specimens& specimens, const TestPlan& plan) {
  KesLoops loops;
  for (const std::size_t d : {warp, weft}) {
    loops.tension[d] = run_tension_test(specimens.tension[d], plan);
    loops.bending[d] = run_bending_test(specimens.bending[d], plan);
  }
  loops.shear = run_shear_test(specimens.shear, plan);
  return loops;
}

Specimen material_point(const ModeResponse& response) {
  return [response, before = 0.0, slider = 0.0](double e) mutable {
    slider = std::clamp(slider + (e - before) / response.reversal, -1.0, 1.0);
    before = e;
    return std::copysign(response.elastic.value(std::abs(e)), e) +
           response.friction.value(std::abs(e)) * slider;
  };
}

Specimens material_points(const Fabric& fabric) {
  return {{material_point(fabric.tension[warp]), material_point(fabric.tension[weft])},
          {material_point(fabric.bending[warp]), material_point(fabric.bending[weft])},
          material_point(fabric.shear)};
}

KesLoops steady_loops(const Fabric& fabric) {
  KesLoops loops;
  for (const std::size_t d : {warp, weft}) {
    loops.tension[d] = steady_pull(fabric.tension[d]);
    loops.bending[d] = steady_cycle(fabric.bending[d], kes::bending_end_1_m);
  }
  loops.shear = steady_cycle(fabric.shear, kes::shear_end_rad);
  return loops;
}

std::optional<double> FigureComparison::residual_pct() const {
  if (!given || *given == 0.0) return std::nullopt;
  return 100.0 * (reproduced / *given - 1.0);
}

std::vector<FigureComparison> compare_figures(const KesFigures& given,
                                              const KesFigures& reproduced) {
  std::vector<FigureComparison> comparisons;
  for_each_figure(reproduced, [&](const FigureName& name, const Figure& figure) {
    if (figure) comparisons.push_back({name, std::nullopt, *figure});
  });
  auto next = comparisons.begin();
  for_each_figure(given, [&](const FigureName& name, const Figure& figure) {
    if (next == comparisons.end() || std::string(name.column) != next->name.column ||
        std::string(name.direction) != next->name.direction) {
      return;
    }
    (next++)->given = figure;
  });
  return comparisons;
}

}  // namespace semblance
