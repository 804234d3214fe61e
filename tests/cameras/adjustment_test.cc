#include "semblance/cameras/adjustment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <map>
#include <string>

#include "semblance/core/errors.h"
#include "semblance/core/random.h"
#include "survey_maker.h"

namespace semblance {
namespace {

void disturb(Survey& survey, Random& random) {
  for (Camera& camera : survey.cameras) {
    camera.focal_px *= 1.1;
    camera.principal_px += Eigen::Vector2d(-8.0, 6.0);
    camera.distortion.fill(0.0);
  }
  for (Rigid3& pose : survey.world_from_target) {
    pose.rotation = quaternion_from_rotation_vector(normal_vector(random, 0.03)) * pose.rotation;
    pose.translation_m += normal_vector(random, 0.01);
  }
}

class AdjustmentOf : public ::testing::TestWithParam<Lens> {};

TEST_P(AdjustmentOf, FindsTheCameraOfExactSightings) {
  Random random(11);
  Survey truth = sheet_survey(random, GetParam(), 12);
  add_sightings(truth, random, 0.0);
  Survey start = truth;
  disturb(start, random);
  const Adjustment found = adjust(start, one_camera());
  const Camera &camera = found.survey.cameras[0], &expected = truth.cameras[0];
  EXPECT_TRUE(found.converged);
  EXPECT_LT(found.rms_all_px, 1e-7);
  EXPECT_LT((camera.focal_px - expected.focal_px).norm(), 1e-4);
  EXPECT_LT((camera.principal_px - expected.principal_px).norm(), 1e-4);
  EXPECT_THAT(found.outlier, ::testing::Each(0));
}

INSTANTIATE_TEST_SUITE_P(Lenses, AdjustmentOf,
                         ::testing::Values(Lens::pinhole, Lens::brown2, Lens::brown5,
                                           Lens::fisheye),
                         [](const auto& tested) { return std::string(lens_name(tested.param)); });

TEST(Adjustment, NamesOutliersAndIgnoresThem) {
  Random random(12);
  Survey truth = sheet_survey(random, Lens::brown2, 10);
  add_sightings(truth, random, 0.1);
  Survey start = truth;
  for (std::size_t i = 7; i < start.sightings.size(); i += 40) {
    start.sightings[i].pixel_px += Eigen::Vector2d(5.0, -9.0);
  }
  const Adjustment clean = adjust(truth, one_camera());
  const Adjustment found = adjust(start, one_camera());
  for (std::size_t i = 7; i < start.sightings.size(); i += 40) EXPECT_TRUE(found.outlier[i]);
  EXPECT_NEAR(found.sigma_px, 0.1, 0.01);
  EXPECT_LT(std::abs(found.survey.cameras[0].focal_px.x() - clean.survey.cameras[0].focal_px.x()),
            0.3 * std::sqrt(clean.covariance->cameras[0].intrinsics(0, 0)));
}

TEST(Adjustment, NamesWhatTheSightingsLeaveOpen) {
  // One view of a sheet seen square on: distance and focal length are one.
  Random random(13);
  Survey survey = sheet_survey(random, Lens::pinhole, 1);
  survey.world_from_target[0] = {Eigen::Quaterniond::Identity(), {-0.1, -0.06, 0.4}};
  add_sightings(survey, random, 0.0);
  const Adjustment found = adjust(survey, one_camera());
  EXPECT_FALSE(found.covariance.has_value());
  EXPECT_NE(found.undetermined, "");
}

TEST(Adjustment, FindsABentSheetAndAnOffset) {
  Random random(14);
  Survey truth = sheet_survey(random, Lens::brown2, 12);
  truth.warp_m = {1.5e-3, -0.8e-3, 0.4e-3};
  truth.time_offset_s = {0.0};
  add_sightings(truth, random, 0.05);
  Survey start = truth;
  start.warp_m.setZero();
  AdjustmentOptions options = one_camera();
  options.warp = true;
  const Adjustment found = adjust(start, options);
  ASSERT_TRUE(found.covariance.has_value());
  const Eigen::Vector3d error = found.survey.warp_m - truth.warp_m;
  EXPECT_LT(error.dot(found.covariance->warp.inverse() * error), 16.3);  // chi2(3), 99.9 %
  EXPECT_LT(error.norm(), 1e-4);
}

TEST(Adjustment, FindsTheOffsetOfASecondClock) {
  // Two cameras, the sheet gliding, each time another way; the second one's clock is 7 ms off.
  Random random(15);
  Survey truth = sheet_survey(random, Lens::pinhole, 12);
  truth.cameras.push_back(truth.cameras[0]);
  truth.cameras[1].camera_from_world = {quaternion_from_rotation_vector({0.0, 0.4, 0.0}),
                                        {-0.2, 0.0, 0.05}};
  constexpr double offset_s = 0.007, short_s = 1e-4;
  std::vector<Eigen::Vector3d> speed_m_s;
  for (int i = 0; i < 12; ++i) speed_m_s.push_back(normal_vector(random, 0.2));
  for (int c = 0; c < 2; ++c) {
    for (int i = 0; i < 12; ++i) {
      for (int k = 0; k < 54; ++k) {
        const auto seen_at = [&](double time_s) {
          Survey then = truth;
          then.world_from_target[static_cast<std::size_t>(i)].translation_m +=
              time_s * speed_m_s[static_cast<std::size_t>(i)];
          return residual_px(then, Sighting{c, i, k});
        };
        const double when = c == 1 ? offset_s : 0.0;
        Sighting sighting{c, i, k, seen_at(when)};
        sighting.velocity_px_s =
            (seen_at(when + short_s) - seen_at(when - short_s)) / (2.0 * short_s);
        if (sighting.pixel_px.allFinite()) truth.sightings.push_back(sighting);
      }
    }
  }
  AdjustmentOptions options;
  options.cameras = {CameraFreedom::none(), CameraFreedom::pose_only()};
  options.cameras[1].time_offset = true;
  const Adjustment found = adjust(truth, options);
  // The velocities are those of the moment seen: what is left is the acceleration in the picture.
  EXPECT_NEAR(found.survey.time_offset_s[1], offset_s, 1e-4);
}

// Sums of squared normalised errors by the name of the parameter.
class Normalised {
 public:
  void add(const std::string& name, double error, double variance) {
    auto& [sum, count] = sums_[name];
    sum += error * error / variance;
    ++count;
  }
  void add(const std::vector<std::string>& names, const Eigen::VectorXd& errors,
           const Eigen::MatrixXd& covariance) {
    for (std::size_t i = 0; i < names.size(); ++i) {
      const auto at = static_cast<Eigen::Index>(i);
      add(names[i], errors[at], covariance(at, at));
    }
  }
  const std::map<std::string, std::pair<double, int>>& sums() const { return sums_; }

 private:
  std::map<std::string, std::pair<double, int>> sums_;
};

Eigen::VectorXd intrinsics_of(const Camera& camera) {
  Eigen::VectorXd values(4 + coefficient_count(camera.lens));
  values << camera.focal_px, camera.principal_px,
      Eigen::Map<const Eigen::VectorXd>(camera.distortion.data(), coefficient_count(camera.lens));
  return values;
}

// The step from one pose to another: rotation applied from the left, then shift.
Eigen::VectorXd pose_step(const Rigid3& to, const Rigid3& from) {
  Eigen::VectorXd step(6);
  step << rotation_vector_from_quaternion(to.rotation * from.rotation.conjugate()),
      to.translation_m - from.translation_m;
  return step;
}

TEST(Adjustment, ErrorsAreAsLargeAsItsCovarianceSays) {
  // 200 random rigs of three cameras about a sheet, noise of 0.3 px. The first camera's pose is the
  // frame; all else is sought.
  constexpr int rigs = 200;
  Normalised errors;
  for (int rig = 0; rig < rigs; ++rig) {
    Random random(static_cast<std::uint64_t>(1000 + rig));
    Survey truth = sheet_survey(random, Lens::brown5, 8);
    for (int c = 1; c < 3; ++c) {
      Camera camera = truth.cameras[0];
      camera.focal_px *= random.uniform(0.8, 1.3);
      camera.principal_px += Eigen::Vector2d(10.0 * random.normal(), 10.0 * random.normal());
      // About a point 0.4 m in front of the first one.
      const Eigen::Quaterniond turn = quaternion_from_rotation_vector(normal_vector(random, 0.3));
      const Eigen::Vector3d pivot(0.0, 0.0, 0.4);
      camera.camera_from_world = {turn, pivot - turn * pivot};
      truth.cameras.push_back(camera);
    }
    add_sightings(truth, random, 0.3);
    AdjustmentOptions options;
    options.cameras.assign(3, CameraFreedom{});
    options.cameras[0].pose = false;
    const Adjustment found = adjust(truth, options);
    ASSERT_TRUE(found.covariance.has_value()) << found.undetermined;
    for (std::size_t c = 0; c < 3; ++c) {
      const Camera &camera = found.survey.cameras[c], &expected = truth.cameras[c];
      const CameraUncertainty& known = found.covariance->cameras[c];
      errors.add({"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"},
                 intrinsics_of(camera) - intrinsics_of(expected), known.intrinsics);
      if (c == 0) continue;
      errors.add({"camera rx", "camera ry", "camera rz", "camera x", "camera y", "camera z"},
                 pose_step(camera.camera_from_world, expected.camera_from_world), known.pose);
    }
    for (std::size_t i = 0; i < truth.world_from_target.size(); ++i) {
      errors.add({"sheet rx", "sheet ry", "sheet rz", "sheet x", "sheet y", "sheet z"},
                 pose_step(found.survey.world_from_target[i], truth.world_from_target[i]),
                 found.covariance->placements[i]);
    }
    errors.add("sigma_px", found.sigma_px - 0.3,
               0.09 / (2.0 * 2.0 * static_cast<double>(truth.sightings.size())));
  }
  for (const auto& [name, sum] : errors.sums()) {
    const double variance = sum.first / sum.second;
    RecordProperty("variance of " + name, std::to_string(variance));
    EXPECT_GT(variance, 0.8) << name;
    EXPECT_LT(variance, 1.25) << name;
  }
}

TEST(Adjustment, SightingsCountByTheirSpread) {
  // Every other sighting is five times as uncertain as its neighbours.
  constexpr int sheets = 100;
  double honest = 0.0, weighed = 0.0, alike = 0.0;
  for (int sheet = 0; sheet < sheets; ++sheet) {
    Random random(static_cast<std::uint64_t>(3000 + sheet));
    Survey truth = sheet_survey(random, Lens::pinhole, 6);
    add_sightings(truth, random, 0.0);
    for (std::size_t i = 0; i < truth.sightings.size(); ++i) {
      Sighting& sighting = truth.sightings[i];
      sighting.spread = i % 2 == 0 ? 1.0 : 5.0;
      sighting.pixel_px +=
          0.2 * sighting.spread * Eigen::Vector2d(random.normal(), random.normal());
    }
    AdjustmentOptions options = one_camera();
    const Adjustment found = adjust(truth, options);
    const double focal_px = truth.cameras[0].focal_px.x();
    const double error = found.survey.cameras[0].focal_px.x() - focal_px;
    honest += error * error / found.covariance->cameras[0].intrinsics(0, 0);
    weighed += error * error;
    EXPECT_NEAR(found.sigma_px, 0.2, 0.03);
    for (Sighting& sighting : truth.sightings) sighting.spread = 1.0;
    options.outlier_sigmas.reset();
    const double plain = adjust(truth, options).survey.cameras[0].focal_px.x() - focal_px;
    alike += plain * plain;
  }
  EXPECT_NEAR(honest / sheets, 1.0, 0.45);  // three deviations of a mean of 100 squares
  // By theory: 13 / (2 / (1 + 1 / 25)) = 6.8 times the variance.
  EXPECT_GT(alike, 3.5 * weighed);
}

TEST(Adjustment, RefusesWhatItCannotUse) {
  Random random(16);
  Survey survey = sheet_survey(random, Lens::pinhole, 2);
  add_sightings(survey, random, 0.0);
  survey.sightings[3].point = 99;
  EXPECT_THROW(adjust(survey, one_camera()), InvalidInput);
  survey.sightings[3].point = 3;
  survey.sightings[3].pixel_px.x() = std::nan("");
  EXPECT_THROW(adjust(survey, one_camera()), InvalidInput);
  survey.sightings[3].pixel_px.x() = 3.0;
  survey.sightings[3].spread = 0.0;
  EXPECT_THROW(adjust(survey, one_camera()), InvalidInput);
  survey.sightings[3].spread = 1.0;
  survey.world_from_target[1].translation_m.z() = -5.0;
  AdjustmentOptions keep_all = one_camera();
  keep_all.outlier_sigmas.reset();
  EXPECT_THROW(adjust(survey, keep_all), SolverError);
}

TEST(Adjustment, CentreCovarianceIsThatOfCentres) {
  Random random(77);
  Camera camera = Camera::centred(640, 480, 500.0);
  camera.camera_from_world = {quaternion_from_rotation_vector({0.4, -0.7, 0.2}), {0.3, -0.1, 2.0}};
  Eigen::Matrix<double, 6, 6> root;
  for (double& entry : root.reshaped()) entry = 1e-3 * random.normal();
  const Eigen::Vector3d middle = camera.camera_from_world.inverse().translation_m;
  Eigen::Matrix3d sampled = Eigen::Matrix3d::Zero();
  constexpr int samples = 40000;
  for (int i = 0; i < samples; ++i) {
    Eigen::Matrix<double, 6, 1> unit;
    for (double& entry : unit.reshaped()) entry = random.normal();
    const Eigen::Matrix<double, 6, 1> step = root * unit;
    const Rigid3& pose = camera.camera_from_world;
    const Rigid3 moved{quaternion_from_rotation_vector(step.head<3>()) * pose.rotation,
                       pose.translation_m + step.tail<3>()};
    const Eigen::Vector3d off = moved.inverse().translation_m - middle;
    sampled += off * off.transpose() / samples;
  }
  CameraUncertainty known;
  known.pose = root * root.transpose();
  const Eigen::Matrix3d stated = centre_covariance(camera, known);
  EXPECT_LT((sampled - stated).norm(), 0.03 * stated.norm());
}

}  // namespace
}  // namespace semblance
