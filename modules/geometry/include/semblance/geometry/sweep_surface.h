// The homotopy sweep: contours carried along a trajectory and blended into each other.
//
// Source: Moubaraki, Tanaka and Kitamura, ATR TR-C-0089 (1993), sections 2.1 to 2.4, after Tai, Loe
// and Kunii (1991).
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "semblance/core/mesh.h"
#include "semblance/geometry/homotopy.h"
#include "semblance/geometry/planar_contour.h"
#include "semblance/geometry/scaling.h"
#include "semblance/geometry/space_curve.h"

namespace semblance {

/// A contour on the trajectory. All contours of a sweep have as many points; the same u on two of
/// them belongs together (`correspond`).
struct SweepContour {
  PlanarContour contour;  // coordinates along the frame's normal and binormal, metres
  double position = 0.0;  // s on the trajectory
  /// dS_x/ds and dS_y/ds here: the tangent across the contour is that of the trajectory, the frame,
  /// and this growth of the outline. Both sides share it, which makes the joint smooth.
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();
  /// For a joint that is creased on purpose: the slope of the side after it.
  std::optional<Eigen::Vector2d> slope_after{};
  /// Bias k of an inner joint: the tangent vectors of its sides differ by k (eq. 2). By default the
  /// ratio of the intervals (eq. 7), for which s is linear in v.
  std::optional<double> bias{};
};

/// Between two contours.
struct SweepSegment {
  double n = 0.0;                     // blending parameter, > -1
  BlendForm blend = BlendForm::flat;  // rational creases the joints at its ends
  /// (v, S(v)) that the scaling functions are led through, v increasing strictly inside (0, 1).
  std::vector<Eigen::Vector2d> features_x, features_y;
};

/// P(u, v) = T(s) + c_x n(s) + c_y b(s) with s = s(v) and
/// c = (1 + S(v)) ((1 - R(v)) C1(u) + R(v) C2(u)), componentwise. v runs over [0, contours - 1];
/// whole numbers are the contours.
class SweepSurface {
 public:
  /// Throws InvalidInput that names the contour or segment: fewer than two contours, positions that
  /// do not increase inside [0, 1], a wrong number of segments, n <= -1, a bias that makes the
  /// trajectory run backwards.
  SweepSurface(MovingFrame frame, std::vector<SweepContour> contours,
               std::vector<SweepSegment> segments);

  struct Sample {
    Eigen::Vector3d position_m, du, dv;
  };
  Sample at(double u, double v) const;
  /// The same with v in [0, 1] inside one segment: tells the sides of a joint apart.
  Sample at(double u, int segment, double v) const;

  /// Every number that shapes the surface, per contour: position, slope_x, slope_y, then
  /// slope_after_x and _y (creased) and bias (where one is set), x and y of each point; per
  /// segment: n, heights of features_x, then of features_y.
  Eigen::VectorXd controls() const;
  std::vector<std::string> control_names() const;
  /// Checked as in the constructor.
  void set_controls(const Eigen::VectorXd& controls);
  /// dP/dcontrols: 3 rows, a column per control.
  Eigen::Matrix3Xd derivatives(double u, int segment, double v) const;

  int segment_count() const { return static_cast<int>(segments_.size()); }
  const std::vector<SweepContour>& contours() const { return contours_; }
  const std::vector<SweepSegment>& segments() const { return segments_; }

  /// Triangles over `around` steps of u and `along` steps of v in each segment, seen from outside
  /// counter-clockwise; `caps` closes the ends.
  Mesh mesh(int around, int along, bool caps) const;

 private:
  struct Pace;
  struct Section;
  void check() const;
  Pace pace(int segment) const;
  Section section(int segment, double v) const;

  MovingFrame frame_;
  std::vector<SweepContour> contours_;
  std::vector<SweepSegment> segments_;
};

}  // namespace semblance
