// The pressure that keeps surfaces apart.
#pragma once

#include <cmath>

namespace semblance {

/// Energy per area of a gap d, its first and its second derivative.
struct BarrierValue {
  double energy_j_m2;
  double pressure_pa;     // -d energy / d gap, not negative
  double stiffness_pa_m;  // d2 energy / d gap2, not negative
};

/// Clamped logarithmic barrier (Li et al., Incremental Potential Contact, SIGGRAPH 2020, eq. 6) in
/// units of a pressure: with s = d / reach
///     energy = -p0 reach (1 - s)^2 ln s,   pressure = p0 ((1 - s)^2 / s + 2 (1 - s) ln(1 / s)).
/// Zero from d = reach on, with two continuous derivatives; infinite for d <= 0.
inline BarrierValue barrier(double gap_m, double reach_m, double p0_pa) {
  if (gap_m >= reach_m) return {0.0, 0.0, 0.0};
  if (!(gap_m > 0.0)) return {INFINITY, INFINITY, INFINITY};
  const double s = gap_m / reach_m, u = 1.0 - s, ln_s = std::log(s);
  return {-p0_pa * reach_m * u * u * ln_s, p0_pa * u * (u / s - 2.0 * ln_s),
          p0_pa / reach_m * (u * (4.0 + u / s) / s - 2.0 * ln_s)};
}

}  // namespace semblance
