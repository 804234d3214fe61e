#include "semblance/cameras/posit.h"

#include <gtest/gtest.h>

#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>

#include "semblance/core/random.h"

namespace semblance {
namespace {

struct Seen {
  Camera camera;
  Rigid3 camera_from_object;
  Eigen::Matrix3Xd points_m;
  Eigen::Matrix2Xd pixels_px;
};

// Points in a box of 0.4 x 0.3 x depth m, about 2 m away.
Seen random_view(Random& random, double depth_m, int count, double noise_px) {
  Seen seen;
  seen.camera = Camera::centred(640, 480, 600.0);
  seen.camera.lens = Lens::brown2;
  seen.camera.distortion = {-0.2, 0.05};
  const Eigen::Vector3d turn(random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0),
                             random.uniform(-3.0, 3.0));
  seen.camera_from_object = {quaternion_from_rotation_vector(turn),
                             {random.uniform(-0.3, 0.3), random.uniform(-0.2, 0.2), 2.0}};
  seen.points_m.resize(3, count);
  seen.pixels_px.resize(2, count);
  for (int i = 0; i < count; ++i) {
    seen.points_m.col(i) << random.uniform(-0.2, 0.2) + 0.1, random.uniform(-0.15, 0.15),
        0.5 * depth_m * random.uniform(-1.0, 1.0);
    seen.pixels_px.col(i) = project(seen.camera, seen.camera_from_object * seen.points_m.col(i)) +
                            noise_px * Eigen::Vector2d(random.normal(), random.normal());
  }
  return seen;
}

double angle_between(const Rigid3& a, const Rigid3& b) {
  return a.rotation.angularDistance(b.rotation);
}

TEST(Posit, FindsTheExactPose) {
  Random random(21);
  for (int trial = 0; trial < 100; ++trial) {
    const Seen seen = random_view(random, 0.3, 8, 0.0);
    const auto found = posit(seen.camera, seen.points_m, seen.pixels_px);
    ASSERT_TRUE(found.has_value());
    EXPECT_LT(angle_between(found->camera_from_object, seen.camera_from_object), 1e-7);
    EXPECT_LT(
        (found->camera_from_object.translation_m - seen.camera_from_object.translation_m).norm(),
        1e-7);
  }
}

TEST(PoseFromPoints, FindsTheExactPoseOfAFlatObject) {
  Random random(22);
  for (int trial = 0; trial < 100; ++trial) {
    Seen seen = random_view(random, 0.0, 10, 0.0);
    // The plane lies anyhow in the object's frame.
    const Rigid3 object_from_sheet{quaternion_from_rotation_vector({0.4, -0.7, 0.2}),
                                   {0.1, 0.2, -0.3}};
    for (auto point : seen.points_m.colwise()) {
      point = object_from_sheet * Eigen::Vector3d(point);
    }
    const Rigid3 expected = seen.camera_from_object * object_from_sheet.inverse();
    EXPECT_FALSE(posit(seen.camera, seen.points_m, seen.pixels_px));
    const auto found = pose_from_points(seen.camera, seen.points_m, seen.pixels_px);
    ASSERT_TRUE(found.has_value());
    EXPECT_LT(angle_between(*found, expected), 1e-6) << trial;
    EXPECT_LT((found->translation_m - expected.translation_m).norm(), 1e-6) << trial;
  }
}

TEST(Posit, IsAboutAsGoodAsOpencvWithNoise) {
  Random random(23);
  double ours = 0.0, theirs = 0.0;
  for (int trial = 0; trial < 200; ++trial) {
    const Seen seen = random_view(random, 0.3, 25, 0.5);
    const auto found = posit(seen.camera, seen.points_m, seen.pixels_px);
    ASSERT_TRUE(found.has_value());
    std::vector<cv::Point3d> points;
    std::vector<cv::Point2d> directions;
    for (Eigen::Index i = 0; i < seen.points_m.cols(); ++i) {
      const Eigen::Vector3d p = seen.points_m.col(i),
                            d = unproject(seen.camera, seen.pixels_px.col(i));
      points.emplace_back(p.x(), p.y(), p.z());
      directions.emplace_back(d.x(), d.y());
    }
    cv::Vec3d turn, shift;
    cv::solvePnP(points, directions, cv::Matx33d::eye(), cv::noArray(), turn, shift, false,
                 cv::SOLVEPNP_SQPNP);
    const Rigid3 reference{quaternion_from_rotation_vector({turn[0], turn[1], turn[2]}),
                           {shift[0], shift[1], shift[2]}};
    ours += std::pow(angle_between(found->camera_from_object, seen.camera_from_object), 2);
    theirs += std::pow(angle_between(reference, seen.camera_from_object), 2);
  }
  // It minimises the error of the orthographic picture, not that of the picture.
  EXPECT_LT(std::sqrt(ours), 2.0 * std::sqrt(theirs));
}

TEST(Posit, HasNoPoseForTooLittle) {
  Random random(24);
  Seen seen = random_view(random, 0.3, 3, 0.0);
  EXPECT_FALSE(posit(seen.camera, seen.points_m, seen.pixels_px));
  seen = random_view(random, 0.3, 8, 0.0);
  seen.points_m.bottomRows<2>().setZero();
  EXPECT_FALSE(posit(seen.camera, seen.points_m, seen.pixels_px));
}

}  // namespace
}  // namespace semblance
