// Contact of a sheet of 1.0 x 0.8 m at 1 and 0.5 cm: gathering near pairs, gaps of near pairs, the
// longest step, and the search for crossings. Draped: over a table with its middle, a fold hanging
// down; rolled: all of it in layers 1.5 mm apart, a case far worse than a drape.
#include <benchmark/benchmark.h>

#include <cmath>

#include "cloth_contact/sheets.h"
#include "semblance/cloth/contact.h"
#include "semblance/core/parallel.h"

namespace semblance {
namespace {

constexpr double reach_m = 1e-3;

ContactSurface sheet_of(double spacing_m) {
  return testing::make_sheet(static_cast<int>(std::lround(1.0 / spacing_m)) + 1,
                             static_cast<int>(std::lround(0.8 / spacing_m)) + 1, spacing_m);
}

Obstacle table() {
  return make_box("table", {0.6, 0.7, 0.5}, {Eigen::Quaterniond::Identity(), {0.0, -0.35, 0.0}});
}

/// Flat on the table; outside of it the sheet hangs down aslant, in pleats.
Points draped(const Points& flat) {
  Points x = flat;
  for (Eigen::Index v = 0; v < x.rows(); ++v) {
    const double past_x = std::max(std::abs(flat(v, 0)) - 0.3005, 0.0);
    const double past_z = std::max(std::abs(flat(v, 2)) - 0.2505, 0.0);
    const double past = std::hypot(past_x, past_z);
    x(v, 1) = 5e-4 - 0.8 * past;
    if (past == 0.0) continue;
    const double along = past_x > 0.0 && past_z > 0.0 ? 0.2 * std::atan2(past_z, past_x)
                         : past_x > 0.0               ? std::abs(flat(v, 2)) - 0.2505
                                                      : std::abs(flat(v, 0)) - 0.3005 + 0.1 * M_PI;
    const double out = 0.5 + 0.3 * std::sin(40.0 * along);
    x(v, 0) = std::copysign(std::min(std::abs(flat(v, 0)), 0.3005) + out * past_x, flat(v, 0));
    x(v, 2) = std::copysign(std::min(std::abs(flat(v, 2)), 0.2505) + out * past_z, flat(v, 2));
  }
  return x;
}

struct Case {
  ContactFinder finder;
  Points x;
};

Case make_case(bool roll, double spacing_m) {
  const ContactSurface surface = sheet_of(spacing_m);
  ContactOptions options;
  options.reach_m = roll ? 2e-3 : reach_m;
  std::vector<Obstacle> obstacles;
  if (!roll) obstacles = {table(), make_plane("floor", {0, -0.7, 0}, {0, 1, 0})};
  const Points x = roll ? testing::rolled(surface.rest_positions_m, 1.5e-3, 0.01)
                        : draped(surface.rest_positions_m);
  return {ContactFinder(surface, obstacles, options), x};
}

void report(benchmark::State& state, Case& c) {
  state.counters["contacts"] = static_cast<double>(c.finder.contacts(c.x).size());
  state.counters["near_pairs"] = static_cast<double>(c.finder.statistics().candidates);
  state.counters["margin_mm"] = 1e3 * c.finder.statistics().margin_m;
}

void gather(benchmark::State& state, bool roll, double spacing_m, int threads) {
  set_thread_count(threads);
  Case c = make_case(roll, spacing_m);
  Points there = c.x;
  // Far enough to gather anew each time, and not a motion in common.
  for (Eigen::Index v = 0; v < there.rows(); ++v) there(v, v % 3) += 0.02;
  c.finder.update(c.x);
  for (auto _ : state) {
    state.PauseTiming();
    c.finder.update(there);
    state.ResumeTiming();
    c.finder.update(c.x);
  }
  report(state, c);
  set_thread_count(0);
}

void gaps(benchmark::State& state, bool roll, double spacing_m, int threads) {
  set_thread_count(threads);
  Case c = make_case(roll, spacing_m);
  c.finder.update(c.x);
  for (auto _ : state) benchmark::DoNotOptimize(c.finder.contacts(c.x).data());
  report(state, c);
  set_thread_count(0);
}

void update_near(benchmark::State& state, bool roll, double spacing_m, int threads) {
  set_thread_count(threads);
  Case c = make_case(roll, spacing_m);
  c.finder.update(c.x);
  for (auto _ : state) c.finder.update(c.x);
  report(state, c);
  set_thread_count(0);
}

void step(benchmark::State& state, bool roll, double spacing_m, int threads, double size_m,
          bool each_vertex) {
  set_thread_count(threads);
  Case c = make_case(roll, spacing_m);
  c.finder.update(c.x);
  const Points dx = testing::crumpled(c.x, size_m, 0.3, 3) - c.x;
  Eigen::VectorXd fractions;
  double fraction = 1.0;
  for (auto _ : state) {
    if (each_vertex) {
      c.finder.max_vertex_steps(c.x, dx, fractions);
    } else {
      benchmark::DoNotOptimize(fraction = c.finder.max_step(c.x, dx));
    }
  }
  report(state, c);
  state.counters["fraction"] = each_vertex ? fractions.mean() : fraction;
  set_thread_count(0);
}

void crossings(benchmark::State& state, bool roll, double spacing_m) {
  Case c = make_case(roll, spacing_m);
  std::size_t found = 0;
  for (auto _ : state) found = c.finder.penetrations(c.x).size();
  state.counters["found"] = static_cast<double>(found);
}

void register_all() {
  for (const bool roll : {false, true}) {
    for (const double spacing_m : {0.01, 0.005}) {
      const std::string name =
          std::string("/") + (roll ? "rolled" : "draped") + (spacing_m == 0.01 ? "/1cm" : "/0.5cm");
      for (const int threads : {1, 2}) {
        const auto add = [&](const std::string& what, const auto& function) {
          benchmark::RegisterBenchmark(
              ("cloth_contact/" + what + name + "/threads:" + std::to_string(threads)).c_str(),
              function)
              ->Unit(benchmark::kMillisecond)
              ->UseRealTime();
        };
        add("gather", [=](benchmark::State& s) { gather(s, roll, spacing_m, threads); });
        add("update", [=](benchmark::State& s) { update_near(s, roll, spacing_m, threads); });
        add("contacts", [=](benchmark::State& s) { gaps(s, roll, spacing_m, threads); });
        for (const auto& [label, size_m] : {std::pair{"0.1mm", 1e-4}, {"10mm", 1e-2}}) {
          const double size = size_m;
          add(std::string("max_step_") + label,
              [=](benchmark::State& s) { step(s, roll, spacing_m, threads, size, false); });
          add(std::string("max_vertex_steps_") + label,
              [=](benchmark::State& s) { step(s, roll, spacing_m, threads, size, true); });
        }
      }
      benchmark::RegisterBenchmark(("cloth_contact/penetrations" + name).c_str(),
                                   [=](benchmark::State& s) { crossings(s, roll, spacing_m); })
          ->Unit(benchmark::kMillisecond)
          ->UseRealTime();
    }
  }
}

const bool registered = (register_all(), true);

}  // namespace
}  // namespace semblance
