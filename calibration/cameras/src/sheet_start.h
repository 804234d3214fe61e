// First estimates for cameras that look at flat sheets.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "semblance/core/camera.h"

namespace semblance {

/// A flat sheet in one picture: columns are points, on the sheet (z = 0) and in the picture.
struct SheetView {
  Eigen::Matrix2Xd sheet_m, pixels_px;
};

/// Focal length from what homographies say of it when distortion is left aside, pixels are square
/// and the principal point is known: each view's two tangent directions of the sheet are of equal
/// length and at right angles (Zhang, "A flexible new technique for camera calibration", PAMI 2000,
/// eq. 3 and 4). None where the views do not tell, as when all face the camera.
std::optional<double> focal_from_sheets(const std::vector<SheetView>& views,
                                        const Eigen::Vector2d& principal_px);

/// camera_from_sheet of one view for a camera with known lens (Collins and Bartoli, "Infinitesimal
/// plane-based pose estimation", IJCV 2014): of its two solutions the one with less error. None
/// for less than four points, points on a line, and pixels that the lens does not show.
std::optional<Rigid3> sheet_pose(const Camera& camera, const SheetView& view);

/// Root mean squared distance of the view's points from where the pose puts them, pixels; infinite
/// where a point lies behind the camera.
double sheet_error_px(const Camera& camera, const Rigid3& camera_from_sheet, const SheetView& view);

}  // namespace semblance
