#include "semblance/geometry/space_curve.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr int steps = 1024;  // of the tabulated frames; an error of the fourth order in 1/steps
constexpr double least_curvature = 1e-9;  // |T' x T''| / |T'|^2: 1 is a radian per unit of s

void require_finite(const Vector3d& v, const char* what) {
  if (!v.allFinite()) throw InvalidInput(std::string("trajectory: ") + what + " must be finite");
}

class Line final : public SpaceCurve {
 public:
  Line(const Vector3d& from, const Vector3d& to) : from_(from), way_(to - from) {}
  CurvePoint at(double s) const override {
    return {from_ + s * way_, way_, Vector3d::Zero(), Vector3d::Zero()};
  }

 private:
  Vector3d from_, way_;
};

class Helix final : public SpaceCurve {
 public:
  Helix(const Vector3d& centre, const Vector3d& axis, const Vector3d& start, double angle,
        double pitch)
      : centre_(centre), angle_(angle), rise_(pitch * angle / (2.0 * std::numbers::pi) * axis) {
    const Vector3d arm = start - centre;
    base_ = arm.dot(axis) * axis;
    x_ = arm - base_;
    y_ = axis.cross(x_);
  }
  CurvePoint at(double s) const override {
    const double c = std::cos(angle_ * s), d = std::sin(angle_ * s), a = angle_;
    return {centre_ + base_ + c * x_ + d * y_ + s * rise_, a * (c * y_ - d * x_) + rise_,
            -a * a * (c * x_ + d * y_), a * a * a * (d * x_ - c * y_)};
  }

 private:
  Vector3d centre_;
  double angle_;
  Vector3d rise_, base_, x_, y_;
};

class Spline final : public SpaceCurve {
 public:
  explicit Spline(const std::vector<Vector3d>& points) {
    const Index n = static_cast<Index>(points.size());
    points_.resize(n, 3);
    knots_ = VectorXd::Zero(n);
    for (Index i = 0; i < n; ++i) {
      points_.row(i) = points[i];
      if (i > 0) knots_[i] = knots_[i - 1] + (points[i] - points[i - 1]).norm();
    }
    knots_ /= knots_[n - 1];
    // Natural ends: no second derivative there.
    MatrixXd system = MatrixXd::Identity(n, n);
    MatrixXd right = MatrixXd::Zero(n, 3);
    for (Index i = 1; i + 1 < n; ++i) {
      const double h0 = knots_[i] - knots_[i - 1], h1 = knots_[i + 1] - knots_[i];
      system(i, i - 1) = h0 / 6.0;
      system(i, i) = (h0 + h1) / 3.0;
      system(i, i + 1) = h1 / 6.0;
      right.row(i) =
          (points_.row(i + 1) - points_.row(i)) / h1 - (points_.row(i) - points_.row(i - 1)) / h0;
    }
    second_ = system.partialPivLu().solve(right);
  }
  CurvePoint at(double s) const override {
    const Index n = knots_.size();
    const double* begin = knots_.data();
    const Index found = std::upper_bound(begin, begin + n, s) - begin - 1;
    const Index i = std::clamp<Index>(found, 0, n - 2);
    const double h = knots_[i + 1] - knots_[i], b = (s - knots_[i]) / h, a = 1.0 - b;
    const Vector3d p0 = points_.row(i), p1 = points_.row(i + 1);
    const Vector3d m0 = second_.row(i), m1 = second_.row(i + 1);
    return {a * p0 + b * p1 + ((a * a * a - a) * m0 + (b * b * b - b) * m1) * (h * h / 6.0),
            (p1 - p0) / h + ((3.0 * b * b - 1.0) * m1 - (3.0 * a * a - 1.0) * m0) * (h / 6.0),
            a * m0 + b * m1, (m1 - m0) / h};
  }

 private:
  VectorXd knots_;
  MatrixXd points_, second_;
};

Vector3d any_across(const Vector3d& tangent) {
  const bool along_y = std::abs(tangent.y()) > 0.9;
  return along_y ? Vector3d::UnitZ() : Vector3d::UnitY();
}

// Derivative of the unit tangent.
Vector3d tangent_ds(const CurvePoint& p, const Vector3d& tangent) {
  return (p.second - p.second.dot(tangent) * tangent) / p.first.norm();
}

// One step of the double reflection: first in the bisector of the two points, then such that the
// tangents agree (Wang, Juettler, Zheng and Liu 2008, table I).
Vector3d reflected_twice(const CurvePoint& from, const CurvePoint& to, const Vector3d& normal) {
  const Vector3d v1 = to.point - from.point;
  const double c1 = v1.squaredNorm();
  if (c1 == 0.0) return normal;
  const Vector3d t0 = from.first.normalized();
  const Vector3d n_left = normal - (2.0 / c1) * v1.dot(normal) * v1;
  const Vector3d t_left = t0 - (2.0 / c1) * v1.dot(t0) * v1;
  const Vector3d v2 = to.first.normalized() - t_left;
  const double c2 = v2.squaredNorm();
  return n_left - (2.0 / c2) * v2.dot(n_left) * v2;
}

}  // namespace

std::shared_ptr<const SpaceCurve> make_line(const Vector3d& from_m, const Vector3d& to_m) {
  require_finite(from_m, "the line's start");
  require_finite(to_m, "the line's end");
  if (!((to_m - from_m).norm() > 0.0)) {
    throw InvalidInput("trajectory: the line's ends must differ");
  }
  return std::make_shared<Line>(from_m, to_m);
}

std::shared_ptr<const SpaceCurve> make_helix(const Vector3d& centre_m, const Vector3d& axis,
                                             const Vector3d& start_m, double angle_rad,
                                             double pitch_m) {
  require_finite(centre_m, "the centre");
  require_finite(axis, "the axis");
  require_finite(start_m, "the start");
  if (!(axis.norm() > 0.0)) throw InvalidInput("trajectory: the axis must have a direction");
  if (!std::isfinite(angle_rad) || angle_rad == 0.0 || !std::isfinite(pitch_m)) {
    throw InvalidInput("trajectory: angle and pitch must be finite, and the angle not zero");
  }
  const Vector3d unit = axis.normalized(), arm = start_m - centre_m;
  if (!((arm - arm.dot(unit) * unit).norm() > 0.0)) {
    throw InvalidInput("trajectory: the start must lie beside the axis");
  }
  return std::make_shared<Helix>(centre_m, unit, start_m, angle_rad, pitch_m);
}

std::shared_ptr<const SpaceCurve> make_spline(const std::vector<Vector3d>& points_m) {
  if (points_m.size() < 2 || points_m.size() > 1000) {
    throw InvalidInput("trajectory: a spline needs 2 to 1000 points");
  }
  for (std::size_t i = 0; i < points_m.size(); ++i) {
    require_finite(points_m[i], "the spline's points");
    if (i > 0 && points_m[i] == points_m[i - 1]) {
      throw InvalidInput("trajectory: point " + std::to_string(i) +
                         " of the spline repeats the one before it; remove it");
    }
  }
  return std::make_shared<Spline>(points_m);
}

MovingFrame::MovingFrame(std::shared_ptr<const SpaceCurve> curve, FrameKind kind,
                         std::optional<Vector3d> up)
    : curve_(std::move(curve)), kind_(kind) {
  Eigen::Matrix3Xd first(3, steps + 1);
  double curvature = INFINITY;
  for (int i = 0; i <= steps; ++i) {
    const CurvePoint p = curve_->at(double(i) / steps);
    first.col(i) = p.first.normalized();
    if (i > 0 && !(first.col(i).dot(first.col(i - 1)) > 0.0)) {
      throw InvalidInput("trajectory: it stops or turns back at " +
                         std::to_string(100 * i / steps) +
                         " % of its way; move the points there so that it goes on");
    }
    curvature = std::min(curvature, p.first.cross(p.second).norm() / p.first.squaredNorm());
  }
  if (kind == FrameKind::frenet) {
    if (!(curvature > least_curvature)) {
      throw InvalidInput(
          "trajectory: it is straight somewhere, where the Frenet frame is not defined; use the "
          "adapted or the rotation-minimising frame");
    }
    return;
  }
  const Vector3d tangent = first.col(0);
  if (up && !up->allFinite()) throw InvalidInput("trajectory: 'up' must be finite");
  const Vector3d wanted = up.value_or(any_across(tangent));
  const Vector3d across = wanted - wanted.dot(tangent) * tangent;
  if (!(across.norm() > 1e-9 * wanted.norm())) {
    throw InvalidInput("trajectory: 'up' must not point along the trajectory's start");
  }
  if (kind == FrameKind::rotation_minimising) {
    fill_normals(across.normalized());
    return;
  }
  // The plane of the tangents: its normal is the direction they have no part in.
  const Eigen::JacobiSVD<Eigen::Matrix3Xd> svd(first, Eigen::ComputeFullU);
  if (svd.singularValues()[2] > 1e-9 * svd.singularValues()[0]) {
    throw InvalidInput(
        "trajectory: it does not lie in a plane, as the adapted frame needs; use the "
        "rotation-minimising frame");
  }
  const bool straight = svd.singularValues()[1] <= 1e-9 * svd.singularValues()[0];
  plane_normal_ =
      straight ? Vector3d(tangent.cross(across).normalized()) : Vector3d(svd.matrixU().col(2));
  if (!straight && plane_normal_.dot(tangent.cross(across)) < 0.0) plane_normal_ *= -1.0;
}

void MovingFrame::fill_normals(const Vector3d& first_normal) {
  normals_.assign(1, first_normal);
  CurvePoint before = curve_->at(0.0);
  for (int i = 1; i <= steps; ++i) {
    const CurvePoint p = curve_->at(double(i) / steps);
    normals_.push_back(reflected_twice(before, p, normals_.back()));
    before = p;
  }
}

FramePoint MovingFrame::at(double s) const {
  const CurvePoint p = curve_->at(s);
  switch (kind_) {
    case FrameKind::frenet:
      return frenet(p);
    case FrameKind::adapted:
      return adapted(p);
    case FrameKind::rotation_minimising:
      break;
  }
  return rotation_minimising(s, p);
}

FramePoint MovingFrame::frenet(const CurvePoint& p) const {
  const Vector3d cross = p.first.cross(p.second);
  FramePoint f;
  f.tangent = p.first.normalized();
  f.binormal = cross.normalized();
  f.normal = f.binormal.cross(f.tangent);
  const double speed = p.first.norm();
  const double curvature = cross.norm() / (speed * speed * speed);
  const double torsion = cross.dot(p.third) / cross.squaredNorm();
  f.normal_ds = speed * (torsion * f.binormal - curvature * f.tangent);
  f.binormal_ds = -speed * torsion * f.normal;
  return f;
}

FramePoint MovingFrame::adapted(const CurvePoint& p) const {
  FramePoint f;
  f.tangent = p.first.normalized();
  f.binormal = plane_normal_;
  f.normal = f.binormal.cross(f.tangent);
  f.normal_ds = f.binormal.cross(tangent_ds(p, f.tangent));
  f.binormal_ds.setZero();
  return f;
}

FramePoint MovingFrame::rotation_minimising(double s, const CurvePoint& p) const {
  const int i = std::clamp(static_cast<int>(s * steps), 0, steps);
  FramePoint f;
  f.tangent = p.first.normalized();
  f.normal = reflected_twice(curve_->at(double(i) / steps), p, normals_[i]);
  f.normal = (f.normal - f.normal.dot(f.tangent) * f.tangent).normalized();
  f.binormal = f.tangent.cross(f.normal);
  const Vector3d turn = tangent_ds(p, f.tangent);
  f.normal_ds = -f.normal.dot(turn) * f.tangent;
  f.binormal_ds = -f.binormal.dot(turn) * f.tangent;
  return f;
}

}  // namespace semblance
