// A recorded laboratory whose cameras are placed by points of the scene, marked by hand in one
// frame of each (beam_marks.json): the corners of a board and a beam, said to be where the
// recording's configuration says, and bolts and squares of which nothing is known.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "semblance/cameras/photo_calibration.h"
#include "semblance/cameras/scene_frame.h"
#include "semblance/io/camera_formats.h"
#include "support.h"

namespace semblance {
namespace {

constexpr const char* kRecording = "body/beam-4cam/calibration";

MarksFile marks_of_scene() {
  MarksFile marks = read_marks(SEMBLANCE_BEAM_MARKS);
  for (MarksFile::Photo& photo : marks.photos) {
    const std::string name = std::filesystem::path(photo.file).filename().string();
    photo.file = (testing::data_path(kRecording) / "extrinsics" / name).string();
  }
  return marks;
}

std::vector<Camera> published_cameras() {
  const auto path = testing::data_path(kRecording) / "Calib.qca.txt";
  return read_cameras(path.string(), *find_camera_format("qualisys")).rig.cameras;
}

// How far the marks are from where cameras see the points that they say themselves.
double median_error_px(const std::vector<Camera>& cameras, const MarksFile& marks) {
  const std::map<std::string, Eigen::Vector3d> points = place_marks(cameras, marks.photos);
  std::vector<double> errors;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    for (const auto& [name, pixel] : marks.photos[i].marks_px) {
      const auto point = points.find(name);
      if (point == points.end()) continue;
      errors.push_back((project_world(cameras[i], point->second) - pixel).norm());
    }
  }
  std::sort(errors.begin(), errors.end());
  return errors[errors.size() / 2];
}

TEST(RealScene, MarksPlaceCamerasBetterThanThePublishedRig) {
  const MarksFile marks = marks_of_scene();
  const std::vector<std::string> names = marks.names();
  PhotoOptions options;
  std::vector<Eigen::Vector3d> rough(names.size(), Eigen::Vector3d::Constant(std::nan("")));
  for (const auto& [name, point] : marks.points_m) {
    const auto at = std::lower_bound(names.begin(), names.end(), name) - names.begin();
    rough[static_cast<std::size_t>(at)] = point;
    options.known_points.push_back({static_cast<int>(at), point, *marks.points_sigma_m});
  }
  const std::vector<Camera> published = published_cameras();
  const PhotoCalibration found =
      calibrate_with_lenses(published, photos_with_marks(marks), rough, options);
  const std::vector<Camera>& cameras = found.survey.cameras;
  EXPECT_LT(found.rms_px, 1.0);
  EXPECT_LE(std::count(found.adjustment->outlier.begin(), found.adjustment->outlier.end(), 1), 3);
  const double ours_px = median_error_px(cameras, marks);
  const double theirs_px = median_error_px(published, marks);
  std::printf("marks: %.2f px median by our places, %.2f px by the published ones\n", ours_px,
              theirs_px);
  EXPECT_LT(ours_px, 1.0);
  EXPECT_GT(theirs_px, 5.0);

  // The board and the beam are where the configuration says, to the millimetres of hand's marks.
  for (const auto& [name, point] : marks.points_m) {
    const auto at = std::lower_bound(names.begin(), names.end(), name) - names.begin();
    EXPECT_LT((found.survey.points_m[static_cast<std::size_t>(at)] - point).norm(), 0.015) << name;
  }
  // The published places miss ours by what their ten pixels are at three metres.
  Eigen::Matrix3Xd ours(3, 4), theirs(3, 4);
  for (Eigen::Index i = 0; i < 4; ++i) {
    const auto at = static_cast<std::size_t>(i);
    ours.col(i) = cameras[at].camera_from_world.inverse().translation_m;
    theirs.col(i) = published[at].camera_from_world.inverse().translation_m;
  }
  const Similarity motion = similarity_between(ours, theirs, true);
  for (Eigen::Index i = 0; i < 4; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const double centre_m = (motion * ours.col(i) - theirs.col(i)).norm();
    const Eigen::Quaterniond turned =
        cameras[at].camera_from_world.rotation * motion.motion.rotation.conjugate();
    const double turn =
        turned.angularDistance(published[at].camera_from_world.rotation) * 180.0 / std::numbers::pi;
    std::printf("%s: %.1f mm, %.2f degrees from the published place\n", cameras[at].name.c_str(),
                1e3 * centre_m, turn);
    EXPECT_LT(centre_m, 0.05);
    EXPECT_LT(turn, 1.0);
  }
}

}  // namespace
}  // namespace semblance
