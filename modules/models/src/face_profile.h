// Windows and profiles that the built-in face's relief and motions are made of.
#pragma once

#include <algorithm>
#include <cmath>

namespace semblance::face {

/// exp(-((x - centre) / width)^2).
inline double bump(double x, double centre, double width) {
  const double d = (x - centre) / width;
  return std::exp(-d * d);
}
inline double bump2(double x, double y, double cx, double cy, double wx, double wy) {
  return bump(x, cx, wx) * bump(y, cy, wy);
}
/// 0 below x0, 1 above x1, linear between.
inline double ramp(double x, double x0, double x1) {
  return std::clamp((x - x0) / (x1 - x0), 0.0, 1.0);
}
/// The same with zero slopes at both ends.
inline double smooth_step(double x, double x0, double x1) {
  const double t = ramp(x, x0, x1);
  return t * t * (3.0 - 2.0 * t);
}
/// Maximum with a rounded edge, at most k log 2 above it.
inline double smooth_max(double a, double b, double k) {
  const double m = std::max(a, b);
  return m + k * std::log(std::exp((a - m) / k) + std::exp((b - m) / k));
}
/// 1 over the pupil, 0 at the corners of an eye whose centre is dx away.
inline double slit_share(double dx) {
  const double s = dx / 15.5;
  return s * s < 1.0 ? 1.0 - s * s : 0.0;
}

}  // namespace semblance::face
