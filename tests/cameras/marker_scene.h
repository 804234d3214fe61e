// Painted pictures of a head with dots, and what was painted.
#pragma once

#include <numbers>

#include "painted_dots.h"
#include "semblance/cameras/marker_calibration.h"

namespace semblance::testing {

/// A head with dots before a camera, and what was painted.
struct Scene {
  DottedObject object;
  Camera camera;
  std::vector<Rigid3> poses;  // per picture
  std::vector<MarkerPicture> pictures;

  /// The disc that a dot shows; -1 for none.
  int disc_of(int picture, int dot) const {
    const auto at = static_cast<std::size_t>(picture);
    return disc_at(object, camera, poses[at],
                   pictures[at].dots[static_cast<std::size_t>(dot)].centre_px);
  }
};

inline Camera scene_camera(Random& random, Lens lens) {
  Camera camera = Camera::centred(640, 480, random.uniform(600.0, 950.0));
  camera.camera_from_world = {};
  camera.lens = lens;
  if (lens == Lens::brown2) camera.distortion = {-0.12, 0.05};
  return camera;
}

inline void add_picture(Scene& scene, const Rigid3& pose, bool follows, const DotPaint& paint,
                        std::uint64_t seed) {
  MarkerPicture picture;
  picture.instant = static_cast<int>(scene.pictures.size());
  picture.name = "picture" + std::to_string(picture.instant);
  picture.width = scene.camera.width;
  picture.height = scene.camera.height;
  picture.follows = follows;
  picture.dots = find_dots(paint_dots(scene.camera, scene.object, pose, paint, seed));
  scene.poses.push_back(pose);
  scene.pictures.push_back(std::move(picture));
}

/// Single photos from all sides.
inline Scene photos(std::uint64_t seed, int count = 6, Lens lens = Lens::pinhole) {
  Random random(seed);
  Scene scene;
  scene.object = dotted_head(random, 40);
  scene.camera = scene_camera(random, lens);
  for (int i = 0; i < count; ++i) {
    const double z = scene.camera.focal_px.x() / 640.0 * random.uniform(0.28, 0.38);
    const Rigid3 pose =
        view_of({random.uniform(-0.6, 0.6), random.uniform(-3.0, 3.0), random.uniform(-0.3, 0.3)},
                {random.uniform(-0.05, 0.05), random.uniform(-0.03, 0.03), z});
    add_picture(scene, pose, false, {}, 1000 * seed + static_cast<std::uint64_t>(i));
  }
  return scene;
}

/// A clip in which the head turns to and fro.
inline Scene clip(std::uint64_t seed, int frames = 40) {
  Random random(seed);
  Scene scene;
  scene.object = dotted_head(random, 40);
  scene.camera = scene_camera(random, Lens::pinhole);
  const double z = scene.camera.focal_px.x() / 640.0 * 0.33;
  const double phase = random.uniform(0.0, 6.0), start = random.uniform(-3.0, 3.0);
  for (int i = 0; i < frames; ++i) {
    const double t = 2.0 * std::numbers::pi * i / frames;
    const Rigid3 pose =
        view_of({0.45 * std::sin(t + phase), start + 0.6 * std::sin(t), 0.0},
                {0.03 * std::sin(t), 0.02 * std::cos(t), z * (1.0 + 0.1 * std::cos(t))});
    add_picture(scene, pose, i > 0, {}, 1000 * seed + static_cast<std::uint64_t>(i));
  }
  return scene;
}

inline double focal_sigma(const MarkerCalibration& found) {
  return std::sqrt(found.adjustment.covariance->cameras[0].intrinsics(0, 0));
}

/// Sightings whose point is not the disc that was painted there.
inline int wrong_names(const Scene& scene, const MarkerCalibration& found) {
  int wrong = 0;
  for (std::size_t i = 0; i < found.adjustment.survey.sightings.size(); ++i) {
    const auto point = static_cast<std::size_t>(found.adjustment.survey.sightings[i].point);
    const int disc = scene.disc_of(found.picture_of_sighting[i], found.dot_of_sighting[i]);
    wrong += found.points[point].name != DottedObject::name_of(disc);
  }
  return wrong;
}

}  // namespace semblance::testing
