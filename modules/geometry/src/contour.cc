#include "semblance/geometry/contour.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;

double wrapped(double angle, double first) {
  const double turned = std::fmod(angle - first, two_pi);
  return turned < 0.0 ? turned + two_pi : turned;
}

// Slope at x1 of the parabola through three points.
Eigen::VectorXd parabola_slope(const Eigen::VectorXd& y0, const Eigen::VectorXd& y1,
                               const Eigen::VectorXd& y2, double h0, double h1) {
  const Eigen::VectorXd d0 = (y1 - y0) / h0, d1 = (y2 - y1) / h1;
  return (h1 * d0 + h0 * d1) / (h0 + h1);
}

std::vector<PeriodicContour> estimated_slopes(const std::vector<double>& z,
                                              const std::vector<PeriodicContour>& contours) {
  const int count = static_cast<int>(contours.size());
  std::vector<PeriodicContour> slopes;
  for (int i = 0; i < count; ++i) {
    const auto value = [&](int k) -> const Eigen::VectorXd& { return contours[k].values(); };
    Eigen::VectorXd m;
    if (count == 2) {
      m = (value(1) - value(0)) / (z[1] - z[0]);
    } else {
      const int c = std::clamp(i, 1, count - 2);
      const double h0 = z[c] - z[c - 1], h1 = z[c + 1] - z[c];
      m = parabola_slope(value(c - 1), value(c), value(c + 1), h0, h1);
      if (i == 0) m = 2.0 * (value(1) - value(0)) / h0 - m;
      if (i == count - 1) m = 2.0 * (value(i) - value(i - 1)) / h1 - m;
    }
    slopes.emplace_back(contours[i].angles_rad(), m);
  }
  return slopes;
}

}  // namespace

PeriodicContour::PeriodicContour(Eigen::VectorXd values)
    : PeriodicContour(
          Eigen::VectorXd::LinSpaced(values.size(), 0.0,
                                     two_pi * double(values.size() - 1) / double(values.size())),
          values) {}

PeriodicContour::PeriodicContour(Eigen::VectorXd angles_rad, Eigen::VectorXd values)
    : angles_(std::move(angles_rad)), values_(std::move(values)) {
  const Eigen::Index n = values_.size();
  if (n < 3 || angles_.size() != n || !values_.allFinite() || !angles_.allFinite()) {
    throw InvalidInput("periodic contour: at least three finite values with as many angles needed");
  }
  for (Eigen::Index i = 1; i < n; ++i) {
    if (!(angles_[i] > angles_[i - 1])) {
      throw InvalidInput("periodic contour: angles must increase");
    }
  }
  if (angles_[0] < 0.0 || angles_[n - 1] >= two_pi) {
    throw InvalidInput("periodic contour: angles must lie in [0, 2 pi)");
  }
  // Continuity of the first derivative at every knot, cyclically: symmetric, positive definite, and
  // tridiagonal but for its corners.
  std::vector<Eigen::Triplet<double>> entries;
  Eigen::VectorXd right = Eigen::VectorXd::Zero(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Index after = (i + 1) % n;
    const double h = (after > 0 ? angles_[after] : angles_[0] + two_pi) - angles_[i];
    const double slope = (values_[after] - values_[i]) / h;
    entries.emplace_back(i, i, h / 3.0);
    entries.emplace_back(after, after, h / 3.0);
    entries.emplace_back(i, after, h / 6.0);
    entries.emplace_back(after, i, h / 6.0);
    right[i] += slope;
    right[after] -= slope;
  }
  Eigen::SparseMatrix<double> system(n, n);
  system.setFromTriplets(entries.begin(), entries.end());
  second_ = Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>(system).solve(right);
}

ValueSlope PeriodicContour::at(double angle_rad) const {
  const Eigen::Index n = values_.size();
  const double angle = angles_[0] + wrapped(angle_rad, angles_[0]);
  const double* begin = angles_.data();
  const Eigen::Index i = std::upper_bound(begin, begin + n, angle) - begin - 1;
  const Eigen::Index j = (i + 1) % n;
  const double h = (j > 0 ? angles_[j] : angles_[0] + two_pi) - angles_[i];
  const double b = (angle - angles_[i]) / h, a = 1.0 - b;
  const double value = a * values_[i] + b * values_[j] +
                       ((a * a * a - a) * second_[i] + (b * b * b - b) * second_[j]) * h * h / 6.0;
  const double slope =
      (values_[j] - values_[i]) / h +
      ((3.0 * b * b - 1.0) * second_[j] - (3.0 * a * a - 1.0) * second_[i]) * h / 6.0;
  return {value, slope};
}

ContourStack::ContourStack(std::vector<double> heights, std::vector<PeriodicContour> contours)
    : heights_(std::move(heights)), contours_(std::move(contours)) {
  initialise();
  slopes_ = estimated_slopes(heights_, contours_);
}

ContourStack::ContourStack(std::vector<double> heights, std::vector<PeriodicContour> contours,
                           std::vector<PeriodicContour> slopes)
    : heights_(std::move(heights)), contours_(std::move(contours)), slopes_(std::move(slopes)) {
  if (slopes_.size() != contours_.size()) {
    throw InvalidInput("contour stack: one slope contour per contour expected");
  }
  initialise();
}

void ContourStack::initialise() {
  if (heights_.size() < 2 || heights_.size() != contours_.size()) {
    throw InvalidInput("contour stack: at least two contours with as many heights needed");
  }
  for (std::size_t i = 1; i < heights_.size(); ++i) {
    if (!(heights_[i] > heights_[i - 1])) {
      throw InvalidInput("contour stack: heights must increase");
    }
    if (contours_[i].angles_rad() != contours_[0].angles_rad()) {
      throw InvalidInput("contour stack: contours must have the same knots");
    }
  }
  const std::size_t segments = heights_.size() - 1;
  blend_.assign(segments, 0.0);
  speed_start_.resize(segments);
  for (std::size_t i = 0; i < segments; ++i) speed_start_[i] = heights_[i + 1] - heights_[i];
  speed_end_ = speed_start_;
}

void ContourStack::set_bias(int joint, double k) {
  if (joint < 1 || joint > contour_count() - 2 || !(k > 0.0)) {
    throw InvalidInput("contour stack: a bias k > 0 belongs to an inner contour");
  }
  // The geometric mean of the two speeds stays that of the linear trajectory.
  const double below = heights_[joint] - heights_[joint - 1];
  const double above = heights_[joint + 1] - heights_[joint];
  speed_end_[joint - 1] = std::sqrt(below * above * k);
  speed_start_[joint] = std::sqrt(below * above / k);
}

void ContourStack::set_blend(int segment, double n) {
  if (segment < 0 || segment > contour_count() - 2 || !(n > -1.0)) {
    throw InvalidInput("contour stack: a blending parameter n > -1 belongs to a segment");
  }
  blend_[segment] = n;
}

SweptPoint ContourStack::at(double u, double v) const {
  const double inside = std::clamp(v, 0.0, double(contour_count() - 1));
  const int i = std::min(static_cast<int>(inside), contour_count() - 2);
  const double t = inside - i;
  const ValueSlope r0 = contours_[i].at(u), r1 = contours_[i + 1].at(u);
  const ValueSlope m0 = slopes_[i].at(u), m1 = slopes_[i + 1].at(u);
  const double c0 = speed_start_[i], c1 = speed_end_[i];
  // The trajectory keeps n = 0: with it an unbiased segment has z linear in v.
  const ValueSlope z = HomotopyPath{heights_[i], heights_[i + 1], c0, c1, 0.0}.at(t);
  const ValueSlope r =
      HomotopyPath{r0.value, r1.value, c0 * m0.value, c1 * m1.value, blend_[i]}.at(t);
  // d/du is the same homotopy of the u-derivatives, being linear in the ends.
  const ValueSlope d =
      HomotopyPath{r0.slope, r1.slope, c0 * m0.slope, c1 * m1.slope, blend_[i]}.at(t);
  return {r.value, z.value, d.value, r.slope, z.slope};
}

}  // namespace semblance
