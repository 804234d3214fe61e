// Closed contours in polar coordinates and the surface swept through a stack of them.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "semblance/geometry/homotopy.h"

namespace semblance {

/// Periodic function of an angle, the C2 cubic spline through values at increasing angles in
/// [0, 2 pi): a contour r(u) in polar coordinates. At least three values; throws InvalidInput.
class PeriodicContour {
 public:
  PeriodicContour() = default;
  PeriodicContour(Eigen::VectorXd angles_rad, Eigen::VectorXd values);
  /// Values at equal steps from angle 0.
  explicit PeriodicContour(Eigen::VectorXd values);

  ValueSlope at(double angle_rad) const;
  const Eigen::VectorXd& angles_rad() const { return angles_; }
  const Eigen::VectorXd& values() const { return values_; }

 private:
  Eigen::VectorXd angles_, values_, second_;  // second derivatives at the knots
};

/// A point of a swept surface in cylindrical coordinates, with its derivatives.
struct SweptPoint {
  double r = 0.0, z = 0.0;
  double dr_du = 0.0, dr_dv = 0.0, dz_dv = 0.0;
};

/// Contours r_i(u) at heights z_i (increasing) joined to one surface by homotopies.
///
/// Segment i runs from contour i (v = i) to contour i+1 (v = i+1); r and z are both homotopies in
/// v. At a joint both segments have the same tangent line, of slope dr/dz = m_i(u), and their
/// tangent vectors differ by the factor `bias` k: T_below = k T_above (report, eq. 2). By default
/// k = (z_i - z_(i-1)) / (z_(i+1) - z_i), which makes the trajectory z linear in v (eq. 7).
class ContourStack {
 public:
  /// Slopes m_i(u) are estimated from each contour's neighbours by the parabola through three
  /// (end contours: the quadratic's end slope; two contours: the chord). All contours must have the
  /// same knots. Throws InvalidInput.
  ContourStack(std::vector<double> heights, std::vector<PeriodicContour> contours);
  /// With slopes dr/dz given on the contours' knots.
  ContourStack(std::vector<double> heights, std::vector<PeriodicContour> contours,
               std::vector<PeriodicContour> slopes);

  /// Bias k > 0 at an inner joint, and blending parameter n > -1 of a segment.
  void set_bias(int joint, double k);
  void set_blend(int segment, double n);

  int contour_count() const { return static_cast<int>(heights_.size()); }
  const std::vector<double>& heights() const { return heights_; }

  /// Surface point at angle u and v in [0, contour_count() - 1] (clamped).
  SweptPoint at(double u, double v) const;

 private:
  void initialise();

  std::vector<double> heights_;
  std::vector<PeriodicContour> contours_, slopes_;
  std::vector<double> speed_start_, speed_end_;  // dz/dv at the ends of each segment
  std::vector<double> blend_;                    // n of each segment
};

}  // namespace semblance
