// One person's shape from several frames at once.
#pragma once

#include <memory>
#include <vector>

#include "semblance/face/face_fitter.h"

namespace semblance {

/// A frame that takes part, with an estimate of it.
struct Keyframe {
  int frame = 0;
  Eigen::VectorXd x;  // of the model: pose, identity, expression
  std::shared_ptr<const Observation> observation;
  std::vector<FaceMark> marks;  // known points, usually none
};

/// What several frames say of one person.
struct FaceBundle {
  Eigen::VectorXd identity, identity_sigma;
  /// Deviation of the first keyframe's rotation, with what is not known of the shape of the head:
  /// an error that all frames share.
  Eigen::Vector3d rotation_sigma_rad;
  std::vector<Eigen::VectorXd> x;  // per keyframe, all with that identity
  std::vector<ShLight> light;      // per keyframe
};

/// Photometric bundle adjustment (Delaunoy and Pollefeys 2014; Alismail, Browning and Lucey 2016)
/// of a parametric face: one identity, and pose and expression per keyframe, such that each point
/// of the surface has the same albedo in every keyframe that sees it, whatever that albedo is, and
/// that the parts of the face lie where FaceFitter's colours say. The first term knows shape and
/// relative poses (by parallax), the second the absolute pose. Needs at least one keyframe.
FaceBundle adjust_bundle(const FaceFitter& fitter, const MorphModel& model, const Camera& camera,
                         const std::vector<Keyframe>& keyframes);

}  // namespace semblance
