// Recorded rigs: what their published calibrations and ours predict of what neither was fitted to.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <map>
#include <numbers>

#include "semblance/cameras/board_calibration.h"
#include "semblance/cameras/rig_calibration.h"
#include "semblance/cameras/sheet_pictures.h"
#include "semblance/io/camera_formats.h"
#include "support.h"

namespace semblance {
namespace {

using testing::data_path;

constexpr int kCameras = 4;
constexpr double kRate = 6.0;  // of the videos, frames per second
const char* const kRecording = "calibration/charuco-4cam";

std::vector<Camera> published_rig() {
  const std::string path = (data_path(kRecording) / "camera_array.toml").string();
  return read_cameras(path, *find_camera_format("caliscope")).rig.cameras;
}

// Central differences over the frames beside; NaN where one of them does not show the point.
Eigen::Matrix2Xd velocities_px_s(const std::vector<Detection>& frames, std::size_t i) {
  const Detection& now = frames[i];
  Eigen::Matrix2Xd result =
      Eigen::Matrix2Xd::Constant(2, now.points_px.cols(), std::numeric_limits<double>::quiet_NaN());
  if (i == 0 || i + 1 >= frames.size()) return result;
  const Detection &before = frames[i - 1], &after = frames[i + 1];
  const auto column = [](const Detection& detection, int id) {
    return std::find(detection.ids.begin(), detection.ids.end(), id) - detection.ids.begin();
  };
  for (std::size_t k = 0; k < now.ids.size(); ++k) {
    const Eigen::Index a = column(before, now.ids[k]), b = column(after, now.ids[k]);
    if (a == before.points_px.cols() || b == after.points_px.cols()) continue;
    result.col(static_cast<Eigen::Index>(k)) =
        0.5 * kRate * (after.points_px.col(b) - before.points_px.col(a));
  }
  return result;
}

// What the four videos show, found once.
const std::vector<RigView>& recorded_views() {
  static const std::vector<RigView> views = [] {
    const Target target = parse_target("charuco:4x5:0.054:DICT_4X4_1000");
    std::vector<RigView> result;
    for (int c = 0; c < kCameras; ++c) {
      const auto file =
          data_path(kRecording) / "calibration/extrinsic" / ("cam_" + std::to_string(c) + ".mp4");
      const SheetPictures pictures = find_sheet({file.string()}, target, 0, silent_progress());
      for (std::size_t i = 0; i < pictures.detections.size(); ++i) {
        if (!pictures.detections[i].found()) continue;
        result.push_back({c, static_cast<int>(i), pictures.names[i].text(), pictures.detections[i],
                          velocities_px_s(pictures.detections, i)});
      }
    }
    return result;
  }();
  return views;
}

template <class Keep>
std::vector<RigView> chosen(const std::vector<RigView>& views, const Keep& keep) {
  std::vector<RigView> result;
  std::copy_if(views.begin(), views.end(), std::back_inserter(result), keep);
  return result;
}

std::vector<RigCamera> unknown_cameras() {
  return {{.name = "cam_0"}, {.name = "cam_1"}, {.name = "cam_2"}, {.name = "cam_3"}};
}

std::vector<RigCamera> known_cameras(const std::vector<Camera>& cameras, bool keep_pose) {
  std::vector<RigCamera> result;
  for (const Camera& camera : cameras) result.push_back({camera.name, camera, true, keep_pose});
  return result;
}

RigCalibration with_offsets(const std::vector<RigView>& views,
                            const std::vector<RigCamera>& cameras = unknown_cameras()) {
  RigOptions options;
  options.time_offsets = true;
  options.step_s = 1.0 / kRate;
  options.most_lag = 6;
  return calibrate_rig(views, cameras, options);
}

// The views as cameras without offsets would have them; points of unknown speed are left out.
std::vector<RigView> on_one_clock(const std::vector<RigView>& views,
                                  const std::vector<double>& offset_s) {
  std::vector<RigView> result;
  for (RigView view : views) {
    const double offset = offset_s[static_cast<std::size_t>(view.camera)];
    const int lag = static_cast<int>(std::lround(offset * kRate));
    view.instant += lag;
    std::vector<int> ids;
    Eigen::Index count = 0;
    for (std::size_t k = 0; k < view.detection.ids.size(); ++k) {
      const Eigen::Vector2d velocity = view.velocities_px_s.col(static_cast<Eigen::Index>(k));
      if (!velocity.allFinite()) continue;
      ids.push_back(view.detection.ids[k]);
      view.detection.points_px.col(count++) =
          view.detection.points_px.col(static_cast<Eigen::Index>(k)) -
          (offset - lag / kRate) * velocity;
    }
    view.detection.ids = ids;
    view.detection.points_px.conservativeResize(2, count);
    if (count >= 6) result.push_back(view);
  }
  return result;
}

// Distances from where the other cameras (two at least) say that points are to where `camera` sees
// them. Nothing is fitted but the sheet's place, to the others.
std::vector<double> prediction_errors_px(const std::vector<Camera>& cameras,
                                         const std::vector<RigView>& views, int camera) {
  std::map<int, int> others;
  for (const RigView& view : views) others[view.instant] += view.camera != camera;
  const auto seen = chosen(views, [&](const RigView& view) {
    return view.camera != camera && others[view.instant] >= 2;
  });
  const RigCalibration placed = calibrate_rig(seen, known_cameras(cameras, true), {});
  Survey survey = placed.adjustment.survey;
  std::vector<double> errors;
  for (const RigView& view : views) {
    const auto instant = std::find(placed.instants.begin(), placed.instants.end(), view.instant);
    if (view.camera != camera || instant == placed.instants.end()) continue;
    for (std::size_t k = 0; k < view.detection.ids.size(); ++k) {
      survey.points_m[0] = point_on_sheet(view.detection.target, view.detection.ids[k]);
      const Sighting sighting{camera, static_cast<int>(instant - placed.instants.begin()), 0,
                              view.detection.points_px.col(static_cast<Eigen::Index>(k))};
      errors.push_back(residual_px(survey, sighting).norm());
    }
  }
  std::sort(errors.begin(), errors.end());
  return errors;
}

double median(const std::vector<double>& sorted) { return sorted[sorted.size() / 2]; }

// By camera, errors of predictions on instants that the rig did not learn from; the halves take
// turns. `rig_from` makes a rig of the views to learn from.
template <class RigFrom>
std::vector<std::vector<double>> held_out_errors_px(const std::vector<RigView>& views,
                                                    const RigFrom& rig_from) {
  std::vector<std::vector<double>> errors(kCameras);
  for (int half = 0; half < 2; ++half) {
    const auto in_test = [half](const RigView& view) { return (view.instant + 2) % 2 == half; };
    const auto learned = chosen(views, [&](const RigView& view) { return !in_test(view); });
    const std::vector<Camera> rig = rig_from(learned);
    for (int c = 0; c < kCameras; ++c) {
      const std::vector<double> more = prediction_errors_px(rig, chosen(views, in_test), c);
      std::vector<double>& all = errors[static_cast<std::size_t>(c)];
      all.insert(all.end(), more.begin(), more.end());
    }
  }
  for (std::vector<double>& all : errors) std::sort(all.begin(), all.end());
  return errors;
}

std::vector<Camera> learned_rig(const std::vector<RigView>& views) {
  return calibrate_rig(views, unknown_cameras(), {}).cameras;
}

void print(const char* what, std::size_t camera, const std::vector<double>& sorted) {
  std::printf("%s, camera %zu: %zu points, median %.3f px, 95 %% %.3f px\n", what, camera,
              sorted.size(), median(sorted), sorted[sorted.size() * 95 / 100]);
}

// The published rig knew all instants, ours every other one, and none of those tested.
TEST(RealRigs, PredictsACameraBetterThanThePublishedRig) {
  SEMBLANCE_NEED_DATA(kRecording);
  const auto ours = held_out_errors_px(recorded_views(), learned_rig);
  const auto theirs = held_out_errors_px(
      recorded_views(), [](const std::vector<RigView>&) { return published_rig(); });
  for (std::size_t c = 0; c < kCameras; ++c) {
    ASSERT_GT(ours[c].size(), 300u);
    EXPECT_LT(median(ours[c]), median(theirs[c])) << c;
    print("published", c, theirs[c]);
    print("ours", c, ours[c]);
  }
}

// The clock of camera 1 is late by 0.12 s, and in every third picture by 0.07 s less, which its
// time stamps do not say: they deviate by 15 ms at most.
TEST(RealRigs, PredictsACameraOnOneClock) {
  SEMBLANCE_NEED_DATA(kRecording);
  const std::vector<double> offset_s = with_offsets(recorded_views()).time_offset_s;
  EXPECT_NEAR(offset_s[1], -0.12, 0.03);
  EXPECT_NEAR(offset_s[2], 0.02, 0.01);
  EXPECT_NEAR(offset_s[3], 0.02, 0.01);
  const auto ours = held_out_errors_px(on_one_clock(recorded_views(), offset_s), learned_rig);
  for (std::size_t c = 0; c < kCameras; ++c) {
    ASSERT_GT(ours[c].size(), 300u);
    EXPECT_LT(median(ours[c]), c == 1 ? 3.0 : 1.2) << c;
    print("on one clock", c, ours[c]);
  }
}

struct Difference {
  double place_m = 0.0, turn_rad = 0.0;
};

// By camera, after the motion that brings the orientations and then the centres nearest.
std::vector<Difference> differences(const std::vector<Camera>& ours,
                                    const std::vector<Camera>& published) {
  const auto centre = [](const Camera& camera) {
    return camera.camera_from_world.inverse().translation_m;
  };
  Eigen::Vector4d sum = Eigen::Vector4d::Zero();
  for (std::size_t c = 0; c < ours.size(); ++c) {
    const Eigen::Vector4d q =
        (published[c].camera_from_world.rotation.conjugate() * ours[c].camera_from_world.rotation)
            .coeffs();
    sum += q.dot(sum) < 0.0 ? Eigen::Vector4d(-q) : q;
  }
  const Eigen::Quaterniond turn(Eigen::Vector4d(sum.normalized()));
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  for (std::size_t c = 0; c < ours.size(); ++c) {
    shift += (centre(published[c]) - turn * centre(ours[c])) / static_cast<double>(ours.size());
  }
  std::vector<Difference> result;
  for (std::size_t c = 0; c < ours.size(); ++c) {
    result.push_back({(turn * centre(ours[c]) + shift - centre(published[c])).norm(),
                      (ours[c].camera_from_world.rotation * turn.conjugate())
                          .angularDistance(published[c].camera_from_world.rotation)});
  }
  return result;
}

// With the published lenses, which were found from other pictures.
TEST(RealRigs, StandsNearThePublishedRig) {
  SEMBLANCE_NEED_DATA(kRecording);
  const std::vector<Camera> published = published_rig();
  const auto lenses = known_cameras(published, false);
  const std::vector<std::pair<const char*, std::vector<Camera>>> rigs = {
      {"as recorded", calibrate_rig(recorded_views(), lenses, {}).cameras},
      {"with clocks", with_offsets(recorded_views(), lenses).cameras}};
  for (const auto& [what, rig] : rigs) {
    const std::vector<Difference> found = differences(rig, published);
    for (std::size_t c = 0; c < kCameras; ++c) {
      EXPECT_LT(found[c].place_m, 0.02) << what << c;
      EXPECT_LT(found[c].turn_rad, 0.02) << what << c;
      std::printf("%s, camera %zu: %.1f mm, %.2f degrees from the published one\n", what, c,
                  1e3 * found[c].place_m, 180.0 / std::numbers::pi * found[c].turn_rad);
    }
  }
}

// A camera that was started k pictures late: its clock is then off by k pictures more than that of
// the same pictures with their first numbers.
TEST(RealRigs, DroppedPicturesComeBackAsAnOffset) {
  SEMBLANCE_NEED_DATA(kRecording);
  for (const auto& [camera, dropped] : {std::pair{2, 3}, std::pair{0, 2}}) {
    const std::vector<RigView> numbered = chosen(recorded_views(), [&](const RigView& view) {
      return view.camera != camera || view.instant >= dropped;
    });
    std::vector<RigView> late = numbered;
    for (RigView& view : late) view.instant -= view.camera == camera ? dropped : 0;
    const RigCalibration before = with_offsets(numbered), after = with_offsets(late);
    for (int c = 1; c < kCameras; ++c) {
      const auto i = static_cast<std::size_t>(c);
      const int pictures = (c == camera ? dropped : 0) - (camera == 0 ? dropped : 0);
      const double error_s = after.time_offset_s[i] - before.time_offset_s[i] - pictures / kRate;
      const double sigma_s = after.adjustment.covariance->cameras[i].time_offset_s;
      EXPECT_LT(sigma_s, 0.002) << c;
      EXPECT_LT(std::abs(error_s), sigma_s) << c;
      std::printf("%d pictures of camera %d dropped: camera %d off by %.2f ms, %.3f ms wrong\n",
                  dropped, camera, c, 1e3 * after.time_offset_s[i], 1e3 * error_s);
    }
  }
}

const char* const kBeam = "body/beam-4cam";

std::vector<Detection> stills_of(int camera) {
  Detector detector(parse_target("chessboard:7x4:0.06"));
  std::vector<std::string> files;
  const auto folder = data_path(kBeam) / "calibration/intrinsics" /
                      ("int_cam0" + std::to_string(camera + 1) + "_img");
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    files.push_back(entry.path().string());
  }
  std::sort(files.begin(), files.end());
  std::vector<Detection> found;
  for_each_picture(files, 1, [&](const Picture& picture) {
    found.push_back(detector.detect(picture.image));
    return true;
  });
  return found;
}

std::vector<std::string> numbered(std::size_t count) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < count; ++i) names.push_back("still " + std::to_string(i));
  return names;
}

// How well a camera suits sheets, each placed by itself.
double fit_px(const Camera& camera, const BoardCalibration& stills) {
  Survey survey = stills.adjustment.survey;
  survey.cameras = {camera};
  survey.cameras[0].camera_from_world = {};
  AdjustmentOptions options;
  options.cameras = {CameraFreedom::none()};
  options.covariance = false;
  return adjust(survey, options).rms_px;
}

// The four folders of stills show the same room from the same place: they were taken by one camera,
// which is none of the published four. That, and not the stills' number, is why their principal
// points differ by tens of pixels.
TEST(RealRigs, TheStillsOfFourCamerasAreOfOne) {
  SEMBLANCE_NEED_DATA(kBeam);
  const std::vector<Camera> published =
      read_cameras((data_path(kBeam) / "calibration/Calib.qca.txt").string(),
                   *find_camera_format("qualisys"))
          .rig.cameras;
  std::vector<BoardCalibration> own;
  for (int c = 0; c < kCameras; ++c) {
    const std::vector<Detection> stills = stills_of(c);
    own.push_back(calibrate_board(stills, numbered(stills.size()), {}));
  }
  for (std::size_t c = 0; c < kCameras; ++c) {
    const Eigen::MatrixXd& known = own[c].adjustment.covariance->cameras[0].intrinsics;
    const Eigen::Vector2d sigma_px(std::sqrt(known(2, 2)), std::sqrt(known(3, 3)));
    const Eigen::Vector2d off_px = published[c].principal_px - own[c].camera.principal_px;
    EXPECT_GT(off_px.cwiseQuotient(sigma_px).norm(), 8.0) << c;
    const double published_px = fit_px(published[c], own[c]);
    std::printf(
        "folder %zu: principal %.1f %.1f +- %.1f %.1f, published %.1f %.1f px; fits %.3f, "
        "published %.3f px; by others:",
        c, own[c].camera.principal_px.x(), own[c].camera.principal_px.y(), sigma_px.x(),
        sigma_px.y(), published[c].principal_px.x(), published[c].principal_px.y(),
        own[c].adjustment.rms_px, published_px);
    for (std::size_t other = 0; other < kCameras; ++other) {
      if (other == c) continue;
      const double other_px = fit_px(own[other].camera, own[c]);
      EXPECT_LT(other_px, 0.4) << c << other;
      EXPECT_LT(1.2 * other_px, published_px) << c << other;
      std::printf(" %.3f", other_px);
    }
    std::printf("\n");
  }
}

}  // namespace
}  // namespace semblance
