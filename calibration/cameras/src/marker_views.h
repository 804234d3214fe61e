// What calibrations from dots have in common, whether the dots' places are known or not.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "semblance/cameras/marker_calibration.h"

namespace semblance {

/// Focal lengths in widths of the picture, from wide angle to tele.
inline const std::vector<double> kUsualFocals{0.6, 0.85, 1.2, 1.7, 2.4};

/// The faces of dots, in the object's frame.
struct DotFace {
  Eigen::Vector3d normal;
  double radius_m = 0.0;
};

/// Throws InvalidInput for pictures of one camera that differ in size.
void check_sizes(const std::vector<MarkerPicture>& pictures,
                 const std::vector<std::string>& camera_names);

/// Sightings' pixels as they were measured, less the offset of the outline's centre from the image
/// of the dot's, at the survey's estimates.
void correct_for_perspective(Survey& survey, const std::vector<Eigen::Vector2d>& measured_px,
                             const std::vector<std::optional<DotFace>>& faces);

/// The face of each point of an adjustment, from the ellipses of its sightings that are no outliers
/// (`dots`, one per sighting): Gauss-Newton over normal and radius from the normals that single
/// ellipses say. None for a point whose views do not tell, or tell two normals.
std::vector<std::optional<DotFace>> faces_from_views(const Adjustment& adjustment,
                                                     const std::vector<const Dot*>& dots);

/// Spread of a dot's sighting: centres of thin ellipses are less certain, in proportion to how thin
/// they are (painted dots: 0.011 px facing the camera, 0.047 at 80 degrees).
double spread_of(const Dot& dot);

Eigen::Matrix2Xd centres_px(const std::vector<Dot>& dots);

}  // namespace semblance
