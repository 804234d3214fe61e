// Ellipses of a picture: dark round dots on light ground (`find_dots` turns the picture's lightness
// round for light ones). Places have the first pixel's centre at (0, 0).
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

namespace semblance {

struct Ellipse {
  Eigen::Vector2d centre_px;
  double major_px = 0.0, minor_px = 0.0;  // half axes
  double angle_rad = 0.0;                 // of the major axis, from x towards y

  /// Of the circle of equal area.
  double radius_px() const;
};

/// Dark dots of 2.5 px radius and more, each once.
std::vector<Ellipse> find_ellipses(const cv::Mat& grey);

/// Fits the dual conic to the gradients around an outline (Ouellet and Hebert 2009): each pixel's
/// gradient says a line that the ellipse touches, so blur does not shift it. None where that is no
/// ellipse near the start.
std::optional<Ellipse> refine_ellipse(const cv::Mat& grey, const Ellipse& start);

/// Covariance of the centre of a refined ellipse, px^2: the noise of the grey levels, independent
/// from pixel to pixel and as large as the residuals of the fit say, is carried through the fit to
/// first order.
Eigen::Matrix2d centre_covariance(const cv::Mat& grey, const Ellipse& refined);

}  // namespace semblance
