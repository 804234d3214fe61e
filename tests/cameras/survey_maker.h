// Surveys with a known truth.
#pragma once

#include "semblance/cameras/adjustment.h"
#include "semblance/core/random.h"

namespace semblance {

inline Eigen::Vector3d normal_vector(Random& random, double size) {
  return size * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
}

// A sheet of 9 x 6 points 25 mm apart before one camera that looks along +z.
inline Survey sheet_survey(Random& random, Lens lens, int placements) {
  Survey survey;
  Camera camera = Camera::centred(640, 480, 540.0);
  camera.focal_px.y() = 536.0;
  camera.principal_px = {331.0, 236.0};
  camera.lens = lens;
  const LensCoefficients usual{-0.26, 0.07, 1e-3, -5e-4, 0.0};
  if (lens == Lens::brown2) camera.distortion = {-0.26, 0.07};
  if (lens == Lens::brown5) camera.distortion = usual;
  if (lens == Lens::fisheye) camera.distortion = {-0.02, 0.01, -0.004, 0.001};
  camera.camera_from_world = {};
  survey.cameras = {camera};
  for (int y = 0; y < 6; ++y) {
    for (int x = 0; x < 9; ++x) survey.points_m.emplace_back(0.025 * x, 0.025 * y, 0.0);
  }
  const Eigen::Vector3d middle(0.1, 0.0625, 0.0);
  for (int i = 0; i < placements; ++i) {
    const Eigen::Quaterniond turn = quaternion_from_rotation_vector(normal_vector(random, 0.3));
    const Eigen::Vector3d at(random.uniform(-0.08, 0.08), random.uniform(-0.05, 0.05),
                             random.uniform(0.3, 0.5));
    survey.world_from_target.push_back({turn, at - turn * middle});
  }
  return survey;
}

inline void add_sightings(Survey& survey, Random& random, double sigma_px) {
  for (int camera = 0; camera < static_cast<int>(survey.cameras.size()); ++camera) {
    for (int i = 0; i < static_cast<int>(survey.world_from_target.size()); ++i) {
      for (int k = 0; k < static_cast<int>(survey.points_m.size()); ++k) {
        Sighting sighting{camera, i, k};
        const Eigen::Vector2d pixel = residual_px(survey, sighting);  // seen at zero
        if (!pixel.allFinite()) continue;
        sighting.pixel_px = pixel + sigma_px * Eigen::Vector2d(random.normal(), random.normal());
        survey.sightings.push_back(sighting);
      }
    }
  }
}

inline AdjustmentOptions one_camera() {
  AdjustmentOptions options;
  options.cameras = {CameraFreedom{}};
  options.cameras[0].pose = false;
  return options;
}

}  // namespace semblance
