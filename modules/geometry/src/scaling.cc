#include "semblance/geometry/scaling.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <string>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Row of `controls` (slope, slope, heights) that gives the value at knot `i`; both ends are zero.
VectorXd height_row(Index i, Index knot_count) {
  VectorXd row = VectorXd::Zero(knot_count);
  if (i > 0 && i + 1 < knot_count) row[i + 1] = 1.0;
  return row;
}

// Second derivatives at the knots of the clamped cubic spline, one column per control.
MatrixXd clamped_second_derivatives(const VectorXd& knots) {
  const Index n = knots.size();
  MatrixXd system = MatrixXd::Zero(n, n), right = MatrixXd::Zero(n, n);
  for (Index i = 0; i < n; ++i) {
    // Continuity of the slope at knot i: of the piece after it minus that of the piece before it,
    // or the given slope.
    if (i + 1 < n) {
      const double h = knots[i + 1] - knots[i];
      system(i, i) += h / 3.0;
      system(i, i + 1) += h / 6.0;
      right.row(i) += (height_row(i + 1, n) - height_row(i, n)) / h;
    } else {
      right(i, 1) += 1.0;
    }
    if (i > 0) {
      const double h = knots[i] - knots[i - 1];
      system(i, i - 1) += h / 6.0;
      system(i, i) += h / 3.0;
      right.row(i) -= (height_row(i, n) - height_row(i - 1, n)) / h;
    } else {
      right(i, 0) -= 1.0;
    }
  }
  return system.partialPivLu().solve(right);
}

}  // namespace

ScalingFunction::ScalingFunction(double start_slope, double end_slope,
                                 std::vector<Eigen::Vector2d> features) {
  if (features.size() > most_features) {
    throw InvalidInput("scaling function: " + std::to_string(features.size()) +
                       " feature points; at most " + std::to_string(most_features) +
                       " were expected");
  }
  const Index count = static_cast<Index>(features.size());
  knots_.resize(count + 2);
  controls_.resize(count + 2);
  knots_[0] = 0.0;
  knots_[count + 1] = 1.0;
  controls_[0] = start_slope;
  controls_[1] = end_slope;
  for (Index i = 0; i < count; ++i) {
    knots_[i + 1] = features[i].x();
    controls_[i + 2] = features[i].y();
  }
  for (Index i = 1; i < knots_.size(); ++i) {
    if (!(knots_[i] > knots_[i - 1])) {
      throw InvalidInput("scaling function: feature points must increase strictly inside (0, 1)");
    }
  }
  if (!controls_.allFinite()) {
    throw InvalidInput("scaling function: slopes and heights must be finite");
  }
  second_of_ = clamped_second_derivatives(knots_);
}

ScalingFunction ScalingFunction::through_height(double start_slope, double alpha, double height) {
  return ScalingFunction(start_slope, scaling_through(1.0, start_slope, alpha, height).slope);
}

ScalingFunction::Derivatives ScalingFunction::derivatives(double v) const {
  const Index n = knots_.size();
  const double* begin = knots_.data();
  const Index found = std::upper_bound(begin, begin + n, v) - begin - 1;
  const Index i = std::clamp<Index>(found, 0, n - 2);
  const double h = knots_[i + 1] - knots_[i];
  const double b = (v - knots_[i]) / h, a = 1.0 - b;
  const VectorXd y0 = height_row(i, n), y1 = height_row(i + 1, n);
  const VectorXd m0 = second_of_.row(i), m1 = second_of_.row(i + 1);
  return {a * y0 + b * y1 + ((a * a * a - a) * m0 + (b * b * b - b) * m1) * (h * h / 6.0),
          (y1 - y0) / h + ((3.0 * b * b - 1.0) * m1 - (3.0 * a * a - 1.0) * m0) * (h / 6.0)};
}

ValueSlope ScalingFunction::at(double v) const {
  const Derivatives d = derivatives(v);
  return {d.value.dot(controls_), d.slope.dot(controls_)};
}

ScalingFunction ScalingFunction::with_controls(const VectorXd& controls) const {
  if (controls.size() != controls_.size() || !controls.allFinite()) {
    throw InvalidInput("scaling function: as many finite controls as before were expected");
  }
  ScalingFunction changed = *this;
  changed.controls_ = controls;
  return changed;
}

}  // namespace semblance
