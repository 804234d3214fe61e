#include "semblance/core/camera.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "semblance/core/conventions.h"
#include "semblance/core/errors.h"
#include "semblance/core/random.h"

namespace semblance {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

Camera distorted_camera() {
  Camera camera = Camera::centred(640, 480, 520.0);
  camera.focal_px = {520.0, 515.0};
  camera.principal_px = {331.0, 236.5};
  camera.lens = Lens::brown5;
  camera.distortion = {-0.28, 0.09, 1.2e-3, -0.7e-3, -0.01};
  camera.camera_from_world.rotation =
      quaternion_from_rotation_vector({3.0, 0.2, -0.1}) * camera.camera_from_world.rotation;
  camera.camera_from_world.translation_m = {0.1, -0.2, 0.3};
  return camera;
}

Eigen::Vector2d project_with_opencv(const Camera& camera, const Eigen::Vector3d& point_world_m) {
  const Eigen::Vector3d w = rotation_vector_from_quaternion(camera.camera_from_world.rotation);
  const Eigen::Vector3d t = camera.camera_from_world.translation_m;
  // OpenCV's camera matrix has the principal point where pixel centres are integers.
  const Eigen::Vector2d principal = integer_centred_from_ours(camera.principal_px);
  const cv::Matx33d matrix(camera.focal_px.x(), 0.0, principal.x(), 0.0, camera.focal_px.y(),
                           principal.y(), 0.0, 0.0, 1.0);
  const std::vector<cv::Point3d> points{{point_world_m.x(), point_world_m.y(), point_world_m.z()}};
  std::vector<cv::Point2d> pixels;
  cv::projectPoints(points, cv::Vec3d(w.x(), w.y(), w.z()), cv::Vec3d(t.x(), t.y(), t.z()), matrix,
                    std::vector<double>(camera.distortion.begin(), camera.distortion.end()),
                    pixels);
  return ours_from_integer_centred({pixels[0].x, pixels[0].y});
}

TEST(Camera, CentredLooksAlongMinusZWithYUp) {
  const Camera camera = Camera::centred(640, 480, 500.0);
  EXPECT_TRUE(project_world(camera, {0.0, 0.0, -2.0}).isApprox(Eigen::Vector2d(320.0, 240.0)));
  const Eigen::Vector2d up = project_world(camera, {0.0, 0.1, -2.0});
  EXPECT_TRUE(up.isApprox(Eigen::Vector2d(320.0, 215.0)));
  const Eigen::Vector2d right = project_world(camera, {0.1, 0.0, -2.0});
  EXPECT_TRUE(right.isApprox(Eigen::Vector2d(345.0, 240.0)));
  EXPECT_GT((camera.camera_from_world * Eigen::Vector3d(0.0, 0.0, -2.0)).z(), 0.0);
}

TEST(Camera, DistortionAgreesWithOpencv) {
  const Camera camera = distorted_camera();
  Random random(1);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d point_camera_m(random.uniform(-0.6, 0.6), random.uniform(-0.5, 0.5),
                                         random.uniform(0.9, 2.0));
    const Eigen::Vector3d point_m = camera.camera_from_world.inverse() * point_camera_m;
    const Eigen::Vector2d ours = project_world(camera, point_m);
    EXPECT_LT((ours - project_with_opencv(camera, point_m)).norm(), 1e-8);
  }
}

TEST(Camera, UnprojectInvertsProject) {
  for (Camera camera : {distorted_camera(), distorted_camera().without_distortion()}) {
    for (double y = 0.0; y <= camera.height; y += 20.0) {
      for (double x = 0.0; x <= camera.width; x += 20.0) {
        const Eigen::Vector3d direction = unproject(camera, {x, y});
        EXPECT_EQ(direction.z(), 1.0);
        EXPECT_LT((project(camera, direction * 1.7) - Eigen::Vector2d(x, y)).norm(), 1e-9);
      }
    }
  }
}

TEST(Camera, UnprojectFindsTheDirectionThatWasProjected) {
  // The polynomial folds over outside; inside, the answer must be the branch through the axis.
  const Camera camera = distorted_camera();
  Random random(2);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d point(random.uniform(-0.7, 0.7), random.uniform(-0.6, 0.6), 1.0);
    EXPECT_LT((unproject(camera, project(camera, point)) - point).norm(), 1e-10);
  }
}

TEST(Camera, UnprojectIsNotFiniteWhereTheLensShowsNothing) {
  Camera camera = distorted_camera();
  camera.distortion = {-0.4, 0.0, 0.0, 0.0, 0.0};  // r (1 - 0.4 r^2) never exceeds 0.609
  EXPECT_FALSE(
      unproject(camera, camera.principal_px + Eigen::Vector2d(0.62 * 520.0, 0.0)).allFinite());
  EXPECT_TRUE(
      unproject(camera, camera.principal_px + Eigen::Vector2d(0.60 * 520.0, 0.0)).allFinite());
}

TEST(Camera, ScaledShowsTheSameViewOnAnotherGrid) {
  const Camera camera = distorted_camera();
  const Camera half = camera.scaled(0.5);
  const Eigen::Vector3d point(0.2, 0.1, 1.0);
  EXPECT_TRUE(project(half, point).isApprox(0.5 * project(camera, point), 1e-12));
  EXPECT_EQ(half.width, 320);
  Camera odd = camera;
  odd.width = 101;
  EXPECT_EQ(odd.scaled(0.5).width, 51);  // as downsample_half
}

std::string complaint(const Camera& camera) {
  try {
    validate(camera, "studio.json");
  } catch (const InvalidInput& error) {
    return error.what();
  }
  return "";
}

TEST(Camera, ValidateNamesSourceAndProblem) {
  EXPECT_EQ(complaint(distorted_camera()), "");
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Camera camera = distorted_camera();
  camera.width = 0;
  EXPECT_THAT(complaint(camera), AllOf(HasSubstr("studio.json"), HasSubstr("0 x 480")));
  camera = distorted_camera();
  camera.focal_px.y() = -3.0;
  EXPECT_THAT(complaint(camera), AllOf(HasSubstr("studio.json"), HasSubstr("focal length")));
  camera = distorted_camera();
  camera.principal_px.x() = nan;
  EXPECT_THAT(complaint(camera), HasSubstr("principal point"));
  camera = distorted_camera();
  camera.distortion[3] = nan;
  EXPECT_THAT(complaint(camera), HasSubstr("distortion coefficient p2"));
  camera = distorted_camera();
  camera.camera_from_world.rotation.w() = nan;
  EXPECT_THAT(complaint(camera), HasSubstr("rotation"));
  camera = distorted_camera();
  camera.camera_from_world.translation_m.z() = std::numeric_limits<double>::infinity();
  EXPECT_THAT(complaint(camera), HasSubstr("translation"));
}

}  // namespace
}  // namespace semblance
