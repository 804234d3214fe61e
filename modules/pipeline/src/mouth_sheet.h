// The skin around a moving mouth: what carries a picture's texture along.
#pragma once

#include "semblance/models/mouth_wireframe.h"

namespace semblance {

/// The wireframe of the lips, rings of skin around it, and the inside of the mouth, laid over a
/// picture in which the markers are known. Moved markers take the lips with them. The skin follows
/// in two ways: the head's motion in the picture (the rotation and shift of corners and upper lip,
/// which the jaw does not move) fades over four mouth widths, what is left of the lips' motion over
/// one, and over 1.7 towards the chin, which goes with the lower lip.
///
/// Vertices: the wireframe's points, the rings from the inside out, and the inner contour again for
/// the inside of the mouth, which lies behind the lips.
class MouthSheet {
 public:
  /// Throws InvalidInput where the corners coincide.
  MouthSheet(const MouthWireframe& wireframe, const MouthPoints& markers);

  const MouthPoints& rest_px() const { return rest_px_; }
  /// Lips first, then skin, then the inside of the mouth; counter-clockwise as seen.
  const Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>& triangles() const {
    return triangles_;
  }
  int lip_triangle_count() const { return static_cast<int>(wireframe_.triangles().rows()); }
  int skin_triangle_count() const;

  /// Where all vertices are when the markers are here; at the given markers they are at rest.
  void move(const MouthPoints& markers, MouthPoints& points_px) const;

 private:
  void lay_rings(const MouthPoints& lips);
  void make_triangles();
  int ring_start(int ring) const;

  MouthWireframe wireframe_;
  MouthPoints rest_markers_, rest_px_;
  Eigen::MatrixXd near_share_;  // ring size x rings
  Eigen::VectorXd far_share_;   // per ring
  double cavity_depth_px_ = 0.0;
  Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor> triangles_;
};

}  // namespace semblance
