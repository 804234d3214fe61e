// Rigs before which a sheet moves along a known path, each camera with its own clock.
#include "semblance/cameras/rig_calibration.h"

#include <gmock/gmock.h>

#include <array>
#include <numbers>

#include "semblance/core/errors.h"
#include "semblance/core/random.h"

namespace semblance {
namespace {

constexpr double kRate = 30.0;  // pictures per second
constexpr double kNoise_px = 0.1;
constexpr int kInstants = 50;

double wave(double hertz, double time_s, double phase) {
  return std::sin(2.0 * std::numbers::pi * hertz * time_s + phase);
}

// A sheet in a hand.
Rigid3 sheet_at(double t) {
  const Eigen::Vector3d turn(0.4 * wave(0.37, t, 0.3), 0.4 * wave(0.29, t, 0.0),
                             0.3 * wave(0.2, t, 2.0));
  const Eigen::Vector3d place(0.12 * wave(0.4, t, 0.0), 0.08 * wave(0.31, t, 1.0),
                              0.8 + 0.1 * wave(0.23, t, 0.0));
  const Eigen::Quaterniond rotation = quaternion_from_rotation_vector(turn);
  return {rotation, place - rotation * Eigen::Vector3d(0.12, 0.09, 0.0)};
}

// Cameras around a place 0.8 m before the first one, which is the frame.
std::vector<Camera> cameras_around() {
  std::vector<Camera> cameras;
  for (const Eigen::Vector3d& turn :
       {Eigen::Vector3d(0.0, 0.0, 0.0), {0.05, 0.5, 0.0}, {-0.3, -0.3, 0.1}}) {
    Camera camera = Camera::centred(640, 480, 600.0 + 40.0 * static_cast<double>(cameras.size()));
    const Eigen::Quaterniond rotation = quaternion_from_rotation_vector(turn);
    const Eigen::Vector3d pivot(0.0, 0.0, 0.8);
    camera.camera_from_world = {rotation, pivot - rotation * pivot};
    camera.name = "cam" + std::to_string(cameras.size());
    cameras.push_back(camera);
  }
  return cameras;
}

using Offsets = std::array<double, 3>;  // seconds, as Survey's

Eigen::Vector2d seen_at(const Camera& camera, const Eigen::Vector3d& point_m, double time_s) {
  return project_world(camera, sheet_at(time_s) * point_m);
}

RigView view_of(const Camera& camera, int index, int instant, const Offsets& offset_s,
                Random& random) {
  RigView view;
  view.camera = index;
  view.instant = instant;
  view.name = camera.name;
  const double time_s = instant / kRate + offset_s[static_cast<std::size_t>(index)];
  Detection& detection = view.detection;
  detection.target = parse_target("charuco:8x6:0.03:DICT_4X4_50");
  detection.width = camera.width;
  detection.height = camera.height;
  detection.ids = point_ids(detection.target);
  const auto count = static_cast<Eigen::Index>(detection.ids.size());
  detection.points_px.resize(2, count);
  view.velocities_px_s.resize(2, count);
  for (Eigen::Index k = 0; k < count; ++k) {
    const Eigen::Vector3d point =
        point_on_sheet(detection.target, detection.ids[static_cast<std::size_t>(k)]);
    const Eigen::Vector2d noise(random.normal(), random.normal());
    detection.points_px.col(k) = seen_at(camera, point, time_s) + kNoise_px * noise;
    // From the pictures before and after, as a program has it.
    view.velocities_px_s.col(k) = 0.5 * kRate *
                                  (seen_at(camera, point, time_s + 1.0 / kRate) -
                                   seen_at(camera, point, time_s - 1.0 / kRate));
  }
  return view;
}

std::vector<RigView> views_of(const std::vector<Camera>& cameras, const Offsets& offset_s) {
  Random random(5);
  std::vector<RigView> views;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    for (int i = 0; i < kInstants; ++i) {
      views.push_back(view_of(cameras[c], static_cast<int>(c), i, offset_s, random));
    }
  }
  return views;
}

std::vector<RigCamera> unknown_cameras() { return {{.name = "a"}, {.name = "b"}, {.name = "c"}}; }

// With a guess for each lens to start from, which saves the time to find one.
std::vector<RigCamera> guessed_cameras() {
  std::vector<RigCamera> cameras = unknown_cameras();
  for (RigCamera& camera : cameras) camera.camera = Camera::centred(640, 480, 640.0);
  return cameras;
}

RigOptions with_offsets() {
  return {.lens = Lens::pinhole, .time_offsets = true, .step_s = 1.0 / kRate, .most_lag = 8};
}

TEST(RigCalibration, FindsCamerasAndTheirPlaces) {
  const std::vector<Camera> truth = cameras_around();
  const RigCalibration found =
      calibrate_rig(views_of(truth, {}), unknown_cameras(), {.lens = Lens::pinhole});
  EXPECT_NEAR(found.adjustment.sigma_px, kNoise_px, 0.01);
  ASSERT_TRUE(found.adjustment.covariance);
  const Rigid3 frame = found.cameras[0].camera_from_world;
  constexpr double sigmas = 4.0;
  for (std::size_t c = 0; c < truth.size(); ++c) {
    const CameraUncertainty& known = found.adjustment.covariance->cameras[c];
    const double focal_sigma_px = std::sqrt(known.intrinsics(0, 0));
    EXPECT_LT(focal_sigma_px, 1.0);
    EXPECT_NEAR(found.cameras[c].focal_px.x(), truth[c].focal_px.x(), sigmas * focal_sigma_px);
    const Eigen::Vector2d off_px = found.cameras[c].principal_px - truth[c].principal_px;
    EXPECT_LT(std::abs(off_px.x()), sigmas * std::sqrt(known.intrinsics(2, 2)));
    EXPECT_LT(std::abs(off_px.y()), sigmas * std::sqrt(known.intrinsics(3, 3)));
    if (c == 0) continue;
    const Rigid3 from_first = found.cameras[c].camera_from_world * frame.inverse();
    const Rigid3& expected = truth[c].camera_from_world;
    EXPECT_LT((from_first.translation_m - expected.translation_m).norm(),
              sigmas * std::sqrt(known.pose.bottomRightCorner<3, 3>().trace()));
    EXPECT_LT(from_first.rotation.angularDistance(expected.rotation),
              sigmas * std::sqrt(known.pose.topLeftCorner<3, 3>().trace()));
  }
}

TEST(RigCalibration, FindsClocksThatAreOffByManyPictures) {
  const Offsets offset_s = {0.0, 5.3 / kRate, -2.8 / kRate};
  const RigCalibration found =
      calibrate_rig(views_of(cameras_around(), offset_s), guessed_cameras(), with_offsets());
  ASSERT_TRUE(found.adjustment.covariance);
  EXPECT_EQ(found.time_offset_s[0], 0.0);
  for (std::size_t c = 1; c < 3; ++c) {
    EXPECT_NEAR(found.time_offset_s[c], offset_s[c], 0.01 / kRate) << c;
    EXPECT_LT(found.adjustment.covariance->cameras[c].time_offset_s, 1e-4) << c;
    RecordProperty("error_us_" + std::to_string(c),
                   std::to_string(1e6 * (found.time_offset_s[c] - offset_s[c])));
  }
}

TEST(RigCalibration, DeviationsOfClocksHold) {
  // Offsets below half a picture, in which the path is nearly straight.
  double sum = 0.0;
  int count = 0;
  for (int trial = 0; trial < 8; ++trial) {
    Random random(static_cast<std::uint64_t>(trial));
    Offsets offset_s{};
    for (std::size_t c = 1; c < 3; ++c) offset_s[c] = random.uniform(-0.004, 0.004);
    const std::vector<Camera> truth = cameras_around();
    std::vector<RigView> views;
    for (std::size_t c = 0; c < truth.size(); ++c) {
      for (int i = 0; i < 20; ++i) {
        views.push_back(view_of(truth[c], static_cast<int>(c), i, offset_s, random));
      }
    }
    RigOptions options = with_offsets();
    options.most_lag = 0;
    const RigCalibration found = calibrate_rig(views, guessed_cameras(), options);
    for (std::size_t c = 1; c < 3; ++c) {
      const double sigma_s = found.adjustment.covariance->cameras[c].time_offset_s;
      const double error = (found.time_offset_s[c] - offset_s[c]) / sigma_s;
      sum += error * error;
      ++count;
    }
  }
  RecordProperty("variance", std::to_string(sum / count));
  EXPECT_GT(sum / count, 0.4);
  EXPECT_LT(sum / count, 1.9);
}

TEST(RigCalibration, PointsOfUnknownSpeedSayNothingOfClocks) {
  const Offsets offset_s = {0.0, 0.004, 0.0};
  std::vector<RigView> views = views_of(cameras_around(), offset_s);
  std::size_t known = 0;
  for (RigView& view : views) {
    if (view.instant % 3 == 0) {
      view.velocities_px_s.setConstant(std::nan(""));
    } else {
      known += view.detection.ids.size();
    }
  }
  const RigCalibration found = calibrate_rig(views, guessed_cameras(), with_offsets());
  EXPECT_EQ(found.adjustment.survey.sightings.size(), known);
  EXPECT_NEAR(found.time_offset_s[1], 0.004, 0.01 / kRate);
}

TEST(RigCalibration, NamesCamerasWithoutACommonView) {
  std::vector<RigView> views = views_of(cameras_around(), {});
  for (RigView& view : views) view.instant += view.camera == 2 ? 1000 : 0;
  try {
    calibrate_rig(views, guessed_cameras(), {.lens = Lens::pinhole});
    FAIL();
  } catch (const InvalidInput& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("'a', 'b' and 'c' share no view"));
  }
}

}  // namespace
}  // namespace semblance
