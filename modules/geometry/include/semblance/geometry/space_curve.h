// Trajectories of sweeps and the frames that move along them.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <vector>

namespace semblance {

/// A point of a curve and its derivatives by the parameter, metres.
struct CurvePoint {
  Eigen::Vector3d point, first, second, third;
};

/// A curve in space over s in [0, 1] whose velocity nowhere vanishes.
class SpaceCurve {
 public:
  virtual ~SpaceCurve() = default;
  virtual CurvePoint at(double s) const = 0;
};

/// All throw InvalidInput where the curve would be a point or values are not finite.
std::shared_ptr<const SpaceCurve> make_line(const Eigen::Vector3d& from_m,
                                            const Eigen::Vector3d& to_m);
/// Turns `start_m` about the axis through `centre_m`, and advances by `pitch_m` a turn along it: an
/// arc of a circle (pitch 0) or a helix.
std::shared_ptr<const SpaceCurve> make_helix(const Eigen::Vector3d& centre_m,
                                             const Eigen::Vector3d& axis,
                                             const Eigen::Vector3d& start_m, double angle_rad,
                                             double pitch_m = 0.0);
/// The natural C2 cubic spline through at least two points, parameterised by chord length.
std::shared_ptr<const SpaceCurve> make_spline(const std::vector<Eigen::Vector3d>& points_m);

/// Unit tangent, normal and binormal with b = t x n, and the derivatives of n and b by s.
struct FramePoint {
  Eigen::Vector3d tangent, normal, binormal, normal_ds, binormal_ds;
};

enum class FrameKind {
  frenet,   ///< t, n, b of the curve; needs curvature everywhere
  adapted,  ///< b is the fixed normal of a planar trajectory's plane (Bronsvort, Klok 1985)
  rotation_minimising  ///< n does not turn about t (Wang et al. 2008)
};

/// The frame of a trajectory.
class MovingFrame {
 public:
  /// `up` chooses what the curve leaves open: of a straight line the plane (adapted), otherwise the
  /// first normal (rotation minimising: the part of `up` across the tangent). By default it is the
  /// y axis, or z where the curve starts along y. Throws InvalidInput with the remedy: no curvature
  /// somewhere (frenet), trajectory not planar (adapted), `up` along the tangent, a trajectory that
  /// turns back on itself.
  MovingFrame(std::shared_ptr<const SpaceCurve> curve, FrameKind kind,
              std::optional<Eigen::Vector3d> up = std::nullopt);

  FramePoint at(double s) const;
  const SpaceCurve& curve() const { return *curve_; }

 private:
  FramePoint frenet(const CurvePoint& p) const;
  FramePoint adapted(const CurvePoint& p) const;
  FramePoint rotation_minimising(double s, const CurvePoint& p) const;
  void fill_normals(const Eigen::Vector3d& first_normal);

  std::shared_ptr<const SpaceCurve> curve_;
  FrameKind kind_;
  Eigen::Vector3d plane_normal_ = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3d> normals_;  // rotation minimising, at equal steps of s
};

}  // namespace semblance
