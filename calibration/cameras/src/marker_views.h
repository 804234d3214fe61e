// What calibrations from dots have in common, whether the dots' places are known or not.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "semblance/cameras/marker_calibration.h"

namespace semblance {

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

/// The face whose outlines come closest to those seen: `seen` are ellipses, each with the disc's
/// centre in its camera's frame and that camera's place. Gauss-Newton over normal and radius from
/// the best of the normals that single ellipses say. None where the views do not tell it.
struct SeenFace {
  const Camera* camera = nullptr;
  Rigid3 camera_from_object;
  const Dot* dot = nullptr;
};
std::optional<DotFace> face_from_views(const Eigen::Vector3d& centre_m,
                                       const std::vector<SeenFace>& seen);

Eigen::Matrix2Xd centres_px(const std::vector<Dot>& dots);

}  // namespace semblance
