#include "semblance/cameras/photo_calibration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "photo_survey.h"
#include "semblance/core/errors.h"

namespace semblance {
namespace {

using testing::draped_marks;
using testing::far_start;
using testing::shape_error_m;

class PhotosFromAfar : public ::testing::TestWithParam<int> {};

TEST_P(PhotosFromAfar, LoopAndJointAdjustmentEndAlike) {
  Random random(static_cast<std::uint64_t>(100 + GetParam()));
  const Survey truth = draped_marks(random);
  const Survey start = far_start(truth, random, GetParam() % 2 == 1, 0.05);
  const PhotoCalibration loop = calibrate_by_loop(start, {});
  const PhotoCalibration joint = calibrate_jointly(start, {});
  EXPECT_TRUE(loop.converged);
  EXPECT_TRUE(joint.converged);
  // 300 residuals, some 110 parameters: the noise of 0.5 px a coordinate leaves about 0.57 px.
  EXPECT_NEAR(joint.rms_px, 0.5 * std::sqrt(2.0) * std::sqrt(190.0 / 300.0), 0.08);
  EXPECT_NEAR(loop.rms_px, joint.rms_px, 0.01);
  EXPECT_LT(shape_error_m(joint.survey, truth), 1e-3);
  EXPECT_LT(shape_error_m(loop.survey, truth), 1e-3);
  ASSERT_TRUE(joint.adjustment->covariance.has_value()) << joint.adjustment->undetermined;
  const double sigma_px = std::sqrt(joint.adjustment->covariance->cameras[0].intrinsics(0, 0));
  EXPECT_NEAR(joint.survey.cameras[0].focal_px.x(), 1800.0, 4.0 * sigma_px);
}

INSTANTIATE_TEST_SUITE_P(Trials, PhotosFromAfar, ::testing::Range(0, 8));

TEST(Photos, StartFromAGenericShape) {
  Random random(31);
  const Survey truth = draped_marks(random);
  std::vector<PhotoMarks> photos(6);
  for (std::size_t i = 0; i < photos.size(); ++i) {
    photos[i] = {"photo" + std::to_string(i), 1600, 1200, {}, Eigen::Matrix2Xd(2, 25)};
  }
  for (const Sighting& sighting : truth.sightings) {
    PhotoMarks& photo = photos[static_cast<std::size_t>(sighting.placement)];
    photo.pixels_px.col(static_cast<Eigen::Index>(photo.points.size())) = sighting.pixel_px;
    photo.points.push_back(sighting.point);
  }
  std::vector<Eigen::Vector3d> generic = truth.points_m;
  for (Eigen::Vector3d& point : generic) point += normal_vector(random, 0.03);
  const PhotoCalibration found =
      calibrate_jointly(start_from_photos(photos, generic, 1300.0, {}), {});
  EXPECT_LT(shape_error_m(found.survey, truth), 1e-3);
  EXPECT_NEAR(found.survey.cameras[0].focal_px.x(), 1800.0, 30.0);
}

std::vector<PhotoMarks> marks_of_placements(const Survey& survey) {
  const Camera& camera = survey.cameras[0];
  std::vector<PhotoMarks> photos;
  for (std::size_t i = 0; i < survey.world_from_target.size(); ++i) {
    PhotoMarks photo{"photo" + std::to_string(i), camera.width, camera.height, {}, {}};
    std::vector<Eigen::Vector2d> pixels;
    for (const Sighting& sighting : survey.sightings) {
      if (sighting.placement != static_cast<int>(i)) continue;
      photo.points.push_back(sighting.point);
      pixels.push_back(sighting.pixel_px);
    }
    photo.pixels_px.resize(2, static_cast<Eigen::Index>(pixels.size()));
    for (Eigen::Index k = 0; k < photo.pixels_px.cols(); ++k) {
      photo.pixels_px.col(k) = pixels[static_cast<std::size_t>(k)];
    }
    photos.push_back(std::move(photo));
  }
  return photos;
}

// Over many rigs, the normalised errors of what known points and lenses leave to find: each of n
// figures' mean square is 1 but for 1 / sqrt(n / 2), and the rig's figures go together.
TEST(PhotosWithLenses, DeviationsAreHonest) {
  constexpr int rigs = 60;
  constexpr double sigma_px = 0.5, sigma_m = 0.004;
  const std::vector<int> known{0, 4, 12, 20, 24};
  double centres = 0.0, points = 0.0;
  for (int rig = 0; rig < rigs; ++rig) {
    Random random(static_cast<std::uint64_t>(700 + rig));
    Survey truth = draped_marks(random);
    truth.sightings.clear();
    add_sightings(truth, random, sigma_px);
    PhotoOptions options;
    options.keep_outliers = true;
    std::vector<Eigen::Vector3d> rough = truth.points_m;
    for (Eigen::Vector3d& point : rough) point += normal_vector(random, 0.02);
    for (const int k : known) {
      const auto at = static_cast<std::size_t>(k);
      options.known_points.push_back(
          {k, truth.points_m[at] + normal_vector(random, sigma_m), sigma_m});
    }
    const std::vector<Camera> lenses(truth.world_from_target.size(), truth.cameras[0]);
    const PhotoCalibration found =
        calibrate_with_lenses(lenses, marks_of_placements(truth), rough, options);
    ASSERT_TRUE(found.adjustment->covariance) << found.adjustment->undetermined;
    for (std::size_t i = 0; i < lenses.size(); ++i) {
      const Camera& camera = found.survey.cameras[i];
      const Eigen::Vector3d error = camera.camera_from_world.inverse().translation_m -
                                    truth.world_from_target[i].inverse().translation_m;
      centres += error.dot(
          centre_covariance(camera, found.adjustment->covariance->cameras[i]).llt().solve(error));
    }
    for (const std::size_t k : {2U, 12U, 17U}) {
      const Eigen::Vector3d error = found.survey.points_m[k] - truth.points_m[k];
      points += error.dot(found.adjustment->covariance->points[k].llt().solve(error));
    }
  }
  EXPECT_NEAR(centres / (3.0 * 6.0 * rigs), 1.0, 0.25);
  EXPECT_NEAR(points / (3.0 * 3.0 * rigs), 1.0, 0.25);
}

TEST(PhotosWithLenses, WithoutKnownPointsTheFirstCameraIsTheFrame) {
  Random random(9);
  const Survey truth = draped_marks(random);
  PhotoOptions options;
  const double length_m = (truth.points_m[0] - truth.points_m[24]).norm();
  options.lengths = {{0, 24, length_m, 1e-5}};
  const std::vector<Camera> lenses(truth.world_from_target.size(), truth.cameras[0]);
  const PhotoCalibration found =
      calibrate_with_lenses(lenses, marks_of_placements(truth), truth.points_m, options);
  EXPECT_LT(shape_error_m(found.survey, truth), 1e-3);
  EXPECT_NEAR((found.survey.points_m[0] - found.survey.points_m[24]).norm(), length_m, 1e-4);
  const auto between = [](const Rigid3& a, const Rigid3& b) {
    return (a.inverse().translation_m - b.inverse().translation_m).norm();
  };
  EXPECT_NEAR(
      between(found.survey.cameras[0].camera_from_world, found.survey.cameras[3].camera_from_world),
      between(truth.world_from_target[0], truth.world_from_target[3]), 0.01);
}

TEST(Photos, StartFromMarksAlone) {
  for (const std::uint64_t seed : {31, 32}) {
    Random random(seed);
    Survey truth = draped_marks(random);
    // Every photo lacks some marks, and one has a wrong one.
    std::erase_if(truth.sightings,
                  [&](const Sighting& s) { return (s.placement + s.point) % 7 == 0; });
    truth.sightings[20].pixel_px += Eigen::Vector2d(80.0, -50.0);
    const std::vector<Eigen::Vector3d> unknown(truth.points_m.size(),
                                               Eigen::Vector3d::Constant(std::nan("")));
    const std::vector<PhotoMarks> photos = marks_of_placements(truth);
    const PhotoCalibration found =
        calibrate_jointly(best_start_from_photos(photos, unknown, {}), {});
    EXPECT_LT(shape_error_m(found.survey, truth), 1.5e-3) << seed;
    EXPECT_NEAR(found.survey.cameras[0].focal_px.x(), 1800.0, 40.0) << seed;

    // Three known points are the frame, though they are too few to place a photo.
    PhotoOptions options;
    for (const int k : {0, 4, 20}) {
      options.known_points.push_back({k, truth.points_m[static_cast<std::size_t>(k)], 1e-4});
    }
    const PhotoCalibration framed =
        calibrate_jointly(best_start_from_photos(photos, unknown, options), options);
    for (std::size_t k = 0; k < truth.points_m.size(); ++k) {
      EXPECT_LT((framed.survey.points_m[k] - truth.points_m[k]).norm(), 5e-3) << seed << ' ' << k;
    }
  }
}

TEST(Photos, AMarkThatOnePhotoShowsLeavesTheScaleAlone) {
  Random random(31);
  Survey truth = draped_marks(random);
  std::erase_if(truth.sightings, [](const Sighting& s) { return s.point == 0 && s.placement > 0; });
  const std::vector<Eigen::Vector3d> unknown(truth.points_m.size(),
                                             Eigen::Vector3d::Constant(std::nan("")));
  const PhotoCalibration found =
      calibrate_jointly(best_start_from_photos(marks_of_placements(truth), unknown, {}), {});
  EXPECT_TRUE(found.adjustment->covariance) << found.adjustment->undetermined;
}

TEST(Photos, MarksAloneMustBeShared) {
  Random random(31);
  Survey truth = draped_marks(random);
  const std::vector<Eigen::Vector3d> unknown(truth.points_m.size(),
                                             Eigen::Vector3d::Constant(std::nan("")));
  std::erase_if(truth.sightings, [](const Sighting& s) { return s.point >= 7; });
  EXPECT_THROW(best_start_from_photos(marks_of_placements(truth), unknown, {}), InvalidInput);
}

TEST(Photos, OnePhotoOrTwoSizesAreNamed) {
  const std::vector<Eigen::Vector3d> points(6, Eigen::Vector3d::Zero());
  PhotoMarks photo{"a.jpg", 640, 480, {0}, Eigen::Matrix2Xd::Zero(2, 1)};
  EXPECT_THROW(start_from_photos({photo}, points, 600.0, {}), InvalidInput);
}

}  // namespace
}  // namespace semblance
