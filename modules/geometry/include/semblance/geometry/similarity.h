// How one set of points in the plane lies over another.
#pragma once

#include <Eigen/Geometry>

namespace semblance {

/// The similarity `to_from` without reflection that leaves the least squared distances between
/// columns of `to` and mapped columns of `from`; without `scale`, the rigid motion. (Umeyama 1991;
/// in the plane, rotation and scale are one complex number.) Throws InvalidInput unless there are
/// as many points in both, at least two different ones in `from`, and all are finite.
Eigen::Affine2d fit_similarity(const Eigen::Matrix2Xd& from, const Eigen::Matrix2Xd& to,
                               bool scale = true);

}  // namespace semblance
