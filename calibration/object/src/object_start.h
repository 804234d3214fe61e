// The start from pairs of points and pixels.
#pragma once

#include <string>
#include <vector>

#include "semblance/object/object_calibration.h"

namespace semblance {

struct ObjectStart {
  Camera camera;
  std::vector<Rigid3> camera_from_object;
  bool focal_free = false;
  double rms_px = 0.0;    // of all pairs
  double sigma_px = 0.0;  // of one coordinate of a pair
};

/// Poses by POSIT for a row of focal lengths and one adjustment from each; the best counts. The
/// focal length is sought only where `seek_focal`.
///
/// `sigma_px` joins the residuals with `prior_sigma_px`, which counts as six of them: few pairs
/// tell little of their own errors.
///
/// Throws InvalidInput naming the picture whose pairs give no pose.
ObjectStart start_from_pairs(const std::vector<ObjectPicture>& pictures, const Camera& camera,
                             bool seek_focal, double prior_sigma_px);

/// A focal length as usual lenses have it, to start from.
double usual_focal_px(int width, int height);

}  // namespace semblance
