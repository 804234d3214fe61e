// Closed planar contours, and bringing contours of different parameterisations into correspondence.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "semblance/geometry/contour.h"

namespace semblance {

enum class ContourKind {
  polygon,  ///< straight between its points: corners stay
  smooth    ///< the periodic C2 cubic spline through its points
};

/// A closed curve c(u) in the plane, u in [0, 2 pi), through points at equal steps of u.
class PlanarContour {
 public:
  /// `points_m` holds 3 to 65,536 finite points as columns. Throws InvalidInput.
  explicit PlanarContour(Eigen::Matrix2Xd points_m, ContourKind kind = ContourKind::smooth);

  struct Sample {
    Eigen::Vector2d point, tangent;  // tangent: d/du
  };
  Sample at(double u) const;

  const Eigen::Matrix2Xd& points() const { return points_; }
  ContourKind kind() const { return kind_; }
  /// c(u) = sum of w_k(u) p_k, and its derivative: the weights of the points.
  struct Weights {
    Eigen::VectorXd value, slope;
  };
  Weights weights(double u) const;

 private:
  Eigen::Matrix2Xd points_;
  ContourKind kind_;
  PeriodicContour x_, y_;     // smooth
  PeriodicContour cardinal_;  // smooth: through 1 at point 0 and 0 at all others
};

/// A named shape of 'size_m' about the origin, counter-clockwise from the x axis: "circle"
/// (radius), "square" (half side), "wave" (radius r (1 + 0.15 cos 8 u)), "ellipse" (half axes size
/// and size / 2). Throws InvalidInput that lists the names.
Eigen::Matrix2Xd named_outline(const std::string& name, double size_m, int point_count = 256);

/// Throws InvalidInput naming `source` if an outline has fewer than three different points, is not
/// finite, encloses no area, or crosses itself (as it does when its points are not in order).
void require_simple(const Eigen::Matrix2Xd& outline, const std::string& source);

enum class Correspondence {
  polar,  ///< the same angle about the origin (report, section 2.3.2); star-shaped outlines only
  arc_length,  ///< the same part of the length, from the best starting point
  matched      ///< points of like direction and place: dynamic programming along both outlines
};

/// Outlines (simple polygons, any number of points, either direction) as closed curves in which the
/// same u belongs together: `point_count` points each, counter-clockwise. The first outline starts
/// on the positive x axis about its reference; the reference is the origin (polar) or the centroid.
/// Throws InvalidInput naming the outline and the remedy.
std::vector<Eigen::Matrix2Xd> correspond(const std::vector<Eigen::Matrix2Xd>& outlines,
                                         Correspondence method, int point_count);

}  // namespace semblance
