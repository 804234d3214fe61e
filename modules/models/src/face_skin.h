// The skin of the built-in head as a function of column and row coordinates.
#pragma once

#include <Eigen/Core>
#include <memory>

#include "face_sweep.h"

namespace semblance::face {

inline constexpr double axis_z = -70.0;

/// Height of a path coordinate: the same below the forehead, and running over the crown above, so
/// that contours follow one another evenly up to the vertex.
double height_from_path(double path);

/// Left half of the head's surface (x >= 0), in millimetres.
class Skin {
 public:
  Skin();
  ~Skin();

  /// Column coordinate in [0, column_count - 1], row coordinate in [0, line_count - 1].
  Eigen::Vector3d point(double column, double row) const;
  /// Angle about the head's axis of a column coordinate, 0 in front.
  double angle(double column) const;
  /// 0 at the eye's inner corner, 1 at the outer.
  double eye_fraction(double u) const;
  /// Path coordinate of a row coordinate at an angle.
  double path(double u, double row) const;

 private:
  double line_path(int line, double u) const;
  double lip_relief(double u, double y) const;

  struct Numbers;
  std::unique_ptr<Numbers> numbers_;
};

}  // namespace semblance::face
