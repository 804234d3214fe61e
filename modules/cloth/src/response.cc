#include "semblance/cloth/response.h"

#include <algorithm>
#include <cmath>

namespace semblance {
namespace {

/// Of the slope of tension: what is left in compression once cloth has buckled.
constexpr double buckled_stiffness_fraction = 0.01;

/// Solves sin(theta) / theta = y for theta in [0, pi).
double inverse_sinc(double y) {
  double theta = std::sqrt(6.0 * std::max(0.0, 1.0 - y));  // first term of the series
  theta = std::min(theta, 3.1);
  for (int i = 0; i < 50; ++i) {
    const double s = std::sin(theta) / theta;
    const double slope = (std::cos(theta) - s) / theta;
    const double step = (s - y) / slope;
    theta = std::clamp(theta - step, 1e-9, 3.14159);
    if (std::abs(step) < 1e-13) break;
  }
  return theta;
}

/// The arc alone, y < 1: E = B kappa^2 / 2 with kappa = 2 theta / length.
LawPoint arc_response(double bending_n_m, double length_m, double y) {
  const double scale = 2.0 * bending_n_m / (length_m * length_m);
  if (1.0 - y < 1e-5) {  // series: theta^2 = 6 q + 9/5 q^2 with q = 1 - y
    const double q = 1.0 - y;
    return {scale * (6.0 * q + 1.8 * q * q), -scale * (6.0 + 3.6 * q), scale * 3.6};
  }
  const double theta = inverse_sinc(y);
  const double s = std::sin(theta) / theta, c = std::cos(theta);
  const double slope = (c - s) / theta;  // dy / dtheta
  const double numerator = 2.0 * theta, denominator = slope;
  // d2y/dtheta2 = -s - 2 (c - s) / theta^2.
  const double bend = -s - 2.0 * (c - s) / (theta * theta);
  const double force = numerator / denominator;
  const double stiffness = (2.0 - force * bend) / (slope * slope);
  return {scale * theta * theta, scale * force, scale * stiffness};
}

/// Where the ramp of slope k meets the arc's force, in y.
double ramp_end(double bending_n_m, double stretch_n_m, double length_m) {
  double y = 1.0;
  for (int i = 0; i < 20; ++i) {
    y = std::max(0.05, 1.0 + arc_response(bending_n_m, length_m, y).force / stretch_n_m);
  }
  return y;
}

}  // namespace

LawPoint odd_response(const Curve& elastic, double deformation) {
  const CurvePoint point = elastic.evaluate(std::abs(deformation));
  return {point.integral, deformation < 0.0 ? -point.value : point.value, point.slope};
}

LawPoint tension_response(const Curve& elastic, CompressionLaw law, double buckling_load_n_m,
                          double strain) {
  if (strain >= 0.0 || law == CompressionLaw::as_tension) return odd_response(elastic, strain);
  if (law == CompressionLaw::none) return {};
  // A curve that starts level still gets a start in compression.
  const double secant = elastic.value(elastic.last()) / elastic.last();
  const double slope = std::max(elastic.evaluate(0.0).slope, 0.01 * secant);
  const double rest = buckled_stiffness_fraction * slope;
  LawPoint out{0.5 * rest * strain * strain, rest * strain, rest};
  if (buckling_load_n_m <= 0.0 || slope <= 0.0) return out;
  const double knee = buckling_load_n_m / (slope - rest);
  const double e = std::exp(strain / knee);
  out.energy += buckling_load_n_m * (knee * (e - 1.0) - strain);
  out.force += buckling_load_n_m * (e - 1.0);
  out.stiffness += buckling_load_n_m / knee * e;
  return out;
}

LawPoint interlaced_response(double bending_n_m, double stretch_n_m, double length_m, double y) {
  const double e = y - 1.0;
  const LawPoint ramp{0.5 * stretch_n_m * e * e, stretch_n_m * e, stretch_n_m};
  if (e >= 0.0) return ramp;
  const double end = ramp_end(bending_n_m, stretch_n_m, length_m);
  if (y >= end) return ramp;
  LawPoint arc = arc_response(bending_n_m, length_m, std::max(y, 0.02));
  arc.energy += 0.5 * stretch_n_m * (end - 1.0) * (end - 1.0) -
                arc_response(bending_n_m, length_m, end).energy;
  return arc;
}

LawPoint Dissipation::evaluate(double deformation) const {
  const double rate = deformation - previous;
  LawPoint out{0.5 * damping * rate * rate, damping * rate, damping};
  if (threshold <= 0.0) return out;
  const double stretch = deformation - anchor;
  if (std::abs(stretch) <= reach) {
    const double stiffness = threshold / reach;
    out.energy += 0.5 * stiffness * stretch * stretch;
    out.force += stiffness * stretch;
    out.stiffness += stiffness;
  } else {
    out.energy += threshold * (std::abs(stretch) - 0.5 * reach);
    out.force += std::copysign(threshold, stretch);
  }
  return out;
}

double Dissipation::slipped_anchor(double deformation) const {
  if (reach <= 0.0) return deformation;
  return std::clamp(anchor, deformation - reach, deformation + reach);
}

}  // namespace semblance
