// Sweeping a whole range map of 512 x 512 samples back from what is stored: whole contours with
// measured tangents, and the full method's panels, whose tangents are found from their neighbours.
#include <benchmark/benchmark.h>

#include <cmath>

#include "semblance/geometry/radial_sweep.h"

namespace semblance {
namespace {

constexpr int side = 512;

/// A head's measures with a nose and a step.
RangeMap make_head() {
  RangeMap map;
  map.spacing_m = 0.4 / side;
  map.radius_m.resize(side, side);
  map.samples = RangeMap::Samples::Constant(side, side, RangeSample::measured);
  for (Eigen::Index row = 0; row < side; ++row) {
    for (Eigen::Index column = 0; column < side; ++column) {
      const double h = map.height_m(row), a = map.column_angle_rad(column);
      map.radius_m(row, column) =
          static_cast<float>((h < 0.15 ? 0.06 : 0.09) + 0.01 * std::sin(20 * h) * std::cos(a) +
                             0.03 * std::exp(-std::pow((h - 0.25) / 0.02, 2) - 20 * a * a));
    }
  }
  return map;
}

const RangeMap& head() {
  static const RangeMap map = make_head();
  return map;
}

void restore(benchmark::State& state, const RadialSweep& sweep) {
  for (auto _ : state) {
    const Grid radii = sweep_radii(sweep);
    benchmark::DoNotOptimize(radii.data());
  }
  state.counters["contours"] = sweep.mean_contours();
}

void whole_contours(benchmark::State& state, SweepForm form) {
  restore(state, sweep_measured(head(), rows_every(side, 10), MeasuredTangent::averaged, form));
}

void full_method(benchmark::State& state) {
  PlacedSweepOptions options;
  options.numbers = 52 * side;
  restore(state, sweep_placed(head(), options));
}

BENCHMARK_CAPTURE(whole_contours, single, SweepForm::single_scaling)
    ->Name("radial_sweep/512/single_scaling")
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(whole_contours, both, SweepForm::double_scaling)
    ->Name("radial_sweep/512/double_scaling")
    ->Unit(benchmark::kMillisecond);
BENCHMARK(full_method)->Name("radial_sweep/512/full")->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace semblance
