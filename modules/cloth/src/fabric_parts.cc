#include "fabric_parts.h"

#include <fmt/format.h>

#include <algorithm>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

template <class Loops>
auto& loop_at(Loops& loops, std::size_t mode) {
  switch (mode) {
    case 0:
    case 1:
      return loops.tension[mode];
    case 2:
      return loops.shear;
    case 3:
    case 4:
      return loops.bending[mode - 3];
    default:
      return loops.bending_bias;
  }
}

Loop sorted(Loop loop) {
  std::stable_sort(loop.begin(), loop.end(), [](const LoopSample& a, const LoopSample& b) {
    return a.deformation < b.deformation;
  });
  return loop;
}

Curve curve_through(const Loop& loop, const std::string& source) {
  std::vector<double> x, force;
  for (const LoopSample& sample : loop) {
    x.push_back(sample.deformation);
    force.push_back(sample.force);
  }
  try {
    return {x, force};
  } catch (const InvalidInput& error) {
    throw InvalidInput(source + ": " + error.what());
  }
}

/// Few readings of tension are joined by curves, as in its response: chords would do too much work.
void append_curve(Loop& loop, const Curve& curve, bool falling) {
  constexpr int steps = 200;
  const double from = falling ? curve.last() : curve.first();
  const double to = falling ? curve.first() : curve.last();
  for (int i = 0; i <= steps; ++i) {
    const double x = from + (to - from) * i / steps;
    loop.push_back({x, curve.value(x)});
  }
}

/// A cloth that was pulled is slack before it is back at its length.
void close_slack(Loop& unloading) {
  if (!unloading.empty() && unloading.front().deformation > 0.0) {
    unloading.insert(unloading.begin(), LoopSample{});
  }
}

ModeResponse& mode_of(Fabric& fabric, std::size_t mode) {
  switch (mode) {
    case 0:
    case 1:
      return fabric.tension[mode];
    case 2:
      return fabric.shear;
    default:
      return fabric.bending[mode - 3];
  }
}

std::string typical_sentence(std::size_t mode, const Fabric& typical) {
  const KesFigures figures = figures_of(steady_loops(typical));
  if (mode == 2) {
    return fmt::format(
        "shear not given: G {:.3g} gf/(cm deg), 2HG {:.3g} and 2HG5 {:.3g} gf/cm, "
        "typical of woven clothes",
        figures.shear.g_gf_cm_deg.value_or(0), figures.shear.hg2_gf_cm.value_or(0),
        figures.shear.hg5_gf_cm.value_or(0));
  }
  if (mode < 2) {
    return fmt::format(
        "tension not given: EMT {:.3g} %, LT {:.3g}, RT {:.3g} %, typical of woven "
        "clothes",
        figures.tension[0].emt_pct.value_or(0), figures.tension[0].lt.value_or(0),
        figures.tension[0].rt_pct.value_or(0));
  }
  return fmt::format(
      "bending not given: B {:.3g} gf cm2/cm, 2HB {:.3g} gf cm/cm, typical of woven "
      "clothes",
      figures.bending[0].b_gf_cm2_cm.value_or(0), figures.bending[0].hb2_gf_cm_cm.value_or(0));
}

/// The mode as given, else as in the other direction, else typical.
ModeResponse mode_or_assumed(FabricParts& parts, std::size_t mode, Fabric& typical) {
  if (parts.modes[mode]) return *parts.modes[mode];
  const std::size_t other = mode == 2 ? 2 : (mode < 2 ? 1 - mode : 7 - mode);
  if (parts.modes[other]) {
    parts.assumptions.push_back(
        fmt::format("{} not given: as {}", mode_names[mode].key, mode_names[other].key));
    return *parts.modes[other];
  }
  if (other >= mode) parts.assumptions.push_back(typical_sentence(mode, typical));
  return mode_of(typical, mode);
}

/// The loops of what was given: through measured points first, else the curves.
KesLoops given_loops(const FabricParts& parts, const Fabric& fabric) {
  KesLoops loops = steady_loops(fabric);
  for (std::size_t mode = 0; mode < mode_count; ++mode) {
    if (!parts.modes[mode]) loop_of(loops, mode).clear();
    if (loop_of(parts.measured, mode).empty()) continue;
    const Loop& smooth = loop_of(parts.smooth, mode);
    loop_of(loops, mode) = smooth.empty() ? loop_of(parts.measured, mode) : smooth;
  }
  return loops;
}

}  // namespace

ModeUnits units_of(ModeKind kind, FabricUnits units) {
  if (units == FabricUnits::si) return {1.0, 1.0};
  switch (kind) {
    case ModeKind::tension:
      return {kes::strain_from_pct, kes::n_m_from_gf_cm};
    case ModeKind::shear:
      return {kes::rad_from_deg, kes::n_m_from_gf_cm};
    case ModeKind::bending:
      break;
  }
  return {kes::per_m_from_per_cm, kes::n_from_gf_cm_cm};
}

Loop& loop_of(KesLoops& loops, std::size_t mode) { return loop_at(loops, mode); }
const Loop& loop_of(const KesLoops& loops, std::size_t mode) { return loop_at(loops, mode); }

void add_measured_mode(FabricParts& parts, std::size_t mode, const ModePoints& points,
                       double reversal, const std::string& source) {
  const Loop loading = sorted(points.loading);
  Loop unloading = sorted(points.unloading);
  Loop& loop = loop_of(parts.measured, mode);
  loop = loading;
  loop.insert(loop.end(), unloading.rbegin(), unloading.rend());
  const std::string where = fmt::format("{}: {}", source, mode_names[mode].key);
  const Curve up = curve_through(loading, where + ": loading");
  const bool pulls = mode_names[mode].kind == ModeKind::tension;
  Loop& smooth = loop_of(parts.smooth, mode);
  if (pulls) append_curve(smooth, up, false);
  if (unloading.empty()) {
    parts.assumptions.push_back(
        fmt::format("{}: no unloading given: no friction", mode_names[mode].key));
    parts.modes[mode] = response_from_loop(up, up, Turns::closing, reversal, where);
    return;
  }
  if (pulls) close_slack(unloading);
  const Curve down = curve_through(unloading, where + ": unloading");
  if (pulls) append_curve(smooth, down, true);
  parts.modes[mode] =
      response_from_loop(up, down, pulls ? Turns::closing : Turns::sliding, reversal, where);
}

FabricRecord assemble_fabric(FabricParts parts, const std::string& source) {
  Fabric typical = fabric_from_figures({}, source);
  Fabric fabric;
  fabric.name = parts.name;
  fabric.area_density_kg_m2 = parts.area_density_kg_m2.value_or(0.0);
  fabric.thickness_m = parts.thickness_m.value_or(0.0);
  for (std::size_t mode = 0; mode < 5; ++mode) {
    mode_of(fabric, mode) = mode_or_assumed(parts, mode, typical);
  }
  fabric.bending_bias = parts.modes[5];
  fabric.assumptions = parts.assumptions;
  complete_fabric(fabric, parts.friction, parts.mass_damping_1_s);
  if (parts.assumes_viscosity) fabric.assumptions.push_back(viscosity_assumption());
  if (parts.assumes_reversal) fabric.assumptions.push_back(reversal_assumption());
  validate(fabric, source);
  FabricRecord record{fabric, {}, parts.measured, given_loops(parts, fabric)};
  record.given = figures_of(record.loops);
  record.given.name = fabric.name;
  return record;
}

}  // namespace semblance
