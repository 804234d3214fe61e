// The lips as a wireframe that follows 16 markers.
//
// Source: Moubaraki, Tanaka and Kitamura, "Evaluation of the Homotopy Sweep Technique", ATR
// TR-C-0089 (1993), section 4.5.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "semblance/models/mouth_motion.h"

namespace semblance {

struct MouthWireframeOptions {
  /// Where the contours C1 and C2 lie between the outer markers (0) and the inner ones (1): the
  /// same for all fibres of the muscle around the mouth, and at all times (report, section 4.5.3).
  std::array<double, 2> fibres{1.0 / 3.0, 2.0 / 3.0};
  /// Points p1, p2, ... between neighbouring markers of a contour.
  int points_between = 4;
  /// Where those lie: on straight lines, as in the report, or on a closed C2 curve through the
  /// markers.
  enum class Between { linear, smooth } between = Between::smooth;
};

/// Four contours C0 (outer markers) to C3 (inner markers), each a closed ring of 8 markers and the
/// points between them. Every point is a fixed linear combination of the markers, so the wireframe
/// takes part in whatever moves them: a motion that is affine in the picture moves all points by
/// it.
class MouthWireframe {
 public:
  static constexpr int contour_count = 4;

  /// The smooth curve's knots are spaced by the distances between `markers` (16 rows, as in one key
  /// frame), outer and inner together, and stay so. Throws InvalidInput for fibre proportions that
  /// do not increase inside (0, 1), less than 0 or more than 1000 points between, or markers that
  /// are not 16 or whose neighbours coincide on both contours.
  explicit MouthWireframe(const MouthPoints& markers, const MouthWireframeOptions& options = {});

  int ring_size() const { return static_cast<int>(ring_from_markers_.rows()); }
  int point_count() const { return contour_count * ring_size(); }
  /// Point of contour c at marker i (0 to 7) and `between` places after it.
  int index(int contour, int marker, int between = 0) const;
  /// 0, the two fibres, 1.
  const std::array<double, contour_count>& proportions() const { return proportions_; }
  /// Two per cell between neighbouring contours, counter-clockwise as seen.
  const Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>& triangles() const {
    return triangles_;
  }

  /// All points for 16 markers; contour by contour. `points` is resized.
  void evaluate(const MouthPoints& markers, MouthPoints& points) const;

 private:
  std::array<double, contour_count> proportions_{};
  Eigen::MatrixXd ring_from_markers_;  // ring_size x 8
  Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor> triangles_;
};

/// Texture coordinates of points in a picture of this size (core/conventions.h).
Eigen::Matrix<float, Eigen::Dynamic, 2, Eigen::RowMajor> picture_uvs(const MouthPoints& points_px,
                                                                     int width, int height);

}  // namespace semblance
