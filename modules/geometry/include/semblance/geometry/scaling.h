// Scaling functions of the homotopy sweep: how a swept outline leaves the blend of its contours.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "semblance/geometry/homotopy.h"

namespace semblance {

/// S(v) on [0, 1] with S(0) = S(1) = 0, given slopes at both ends, and led through feature points:
/// the clamped C2 cubic spline. Without feature points it is the report's polynomial v (v-1) ((p0 +
/// p1) v - p0) (section 3.2.4).
class ScalingFunction {
 public:
  static constexpr std::size_t most_features = 64;
  /// `features` holds (v, S(v)), at most `most_features`, with v increasing strictly inside (0, 1).
  /// Throws InvalidInput.
  explicit ScalingFunction(double start_slope = 0.0, double end_slope = 0.0,
                           std::vector<Eigen::Vector2d> features = {});
  /// The cubic of slope `start_slope` at 0 through (alpha, height), 0 < alpha < 1 (appendix I; the
  /// same function as `scaling_through`).
  static ScalingFunction through_height(double start_slope, double alpha, double height);

  ValueSlope at(double v) const;

  /// S and S' are linear in start slope, end slope and the features' heights, in this order.
  int control_count() const { return static_cast<int>(controls_.size()); }
  const Eigen::VectorXd& controls() const { return controls_; }
  struct Derivatives {
    Eigen::VectorXd value, slope;
  };
  Derivatives derivatives(double v) const;
  /// The same feature abscissae with other controls.
  ScalingFunction with_controls(const Eigen::VectorXd& controls) const;

 private:
  Eigen::VectorXd knots_;      // 0, features, 1
  Eigen::VectorXd controls_;   // start slope, end slope, heights
  Eigen::MatrixXd second_of_;  // second derivatives at the knots from controls
};

}  // namespace semblance
