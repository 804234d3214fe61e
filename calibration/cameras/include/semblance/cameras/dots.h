// Round dots in pictures, and where the centre of a round dot falls.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "semblance/core/camera.h"
#include "semblance/io/video.h"

namespace semblance {

/// Against their ground: printed or painted dots are dark, reflective ones light.
enum class DotTone { any, dark, light };

struct DotOptions {
  DotTone tone = DotTone::any;
  double most_sigma_px = 0.3;  // dots whose centre is less certain are left out
};

/// An ellipse in a picture; pixel centres at +0.5.
struct Dot {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();       // of the ellipse, not of the round dot
  double major_px = 0.0, minor_px = 0.0;                     // half axes
  double angle_rad = 0.0;                                    // of the major axis, from x towards y
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Zero();  // of the centre
  bool light = false;

  /// Of the circle of equal area.
  double radius_px() const;
};

/// Dots of 2.5 px radius and more, from the top down. They are looked for in the picture's grey
/// levels and in each of its colours; of what is found twice the more certain one stays. Ellipses
/// are fitted to the gradients at the outline (Ouellet and Hebert, "Precise ellipse estimation
/// without contour point extraction", Machine Vision and Applications 21, 2009). The covariance is
/// that of the noise around the outline, as the residuals of the fit say, carried through the fit;
/// it knows nothing of dots that are not round, and errs on the large side (less than twofold on
/// painted dots), as the residuals hold what blur makes of the outline too.
std::vector<Dot> find_dots(const Rgb8& image, const DotOptions& options = {});

/// A flat round dot in space.
struct Disc {
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  double radius_m = 0.0;
};

/// The outline of a disc in a picture: an ellipse but for the lens.
struct DiscImage {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();  // centroid of the outline's area
  double radius_px = 0.0;                               // of the circle of equal area
};

/// A disc given in the camera's frame, wholly in front of the camera. Without a lens the outline is
/// a conic, whose centre has a closed form (Heikkila, "Geometric camera calibration using circular
/// control points", PAMI 22, 2000): it is not the image of the disc's centre. The lens is applied
/// to points of that outline.
DiscImage image_of(const Camera& camera, const Disc& disc_camera);

/// How far the centre of the outline is from the image of the disc's centre. This is what detected
/// centres have to be reduced by before they are compared with points in space.
Eigen::Vector2d centre_offset_px(const Camera& camera, const Disc& disc_camera);

}  // namespace semblance
