#include "semblance/cameras/scene_frame.h"

#include <gmock/gmock.h>

#include "semblance/core/errors.h"
#include "survey_maker.h"

namespace semblance {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

Rigid3 random_motion(Random& random) {
  return {quaternion_from_rotation_vector(normal_vector(random, 0.8)), normal_vector(random, 2.0)};
}

// Three cameras around five named points, in a world that is right.
Scene right_scene() {
  Scene scene;
  for (const double turn : {-0.5, 0.1, 0.6}) {
    Camera camera = Camera::centred(800, 600, 900.0);
    const Eigen::Quaterniond rotation(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitY()));
    camera.camera_from_world = {rotation, {0.0, 0.0, 2.0}};
    scene.cameras.push_back(camera);
  }
  scene.points_m = {{"a", {0, 0, 0}},
                    {"b", {0.3, 0, 0}},
                    {"c", {0.1, 0.2, 0}},
                    {"d", {0.1, -0.1, 0.2}},
                    {"e", {-0.2, 0.1, 0.1}}};
  return scene;
}

// The same in a world of another unit, turned and shifted.
Scene lost_scene(Random& random, double scale) {
  Scene scene = right_scene();
  move_scene(scene, {scale, random_motion(random)});
  return scene;
}

void expect_same(const Scene& scene, const Scene& expected, double tolerance_m = 1e-9) {
  for (const auto& [name, point] : expected.points_m) {
    EXPECT_LT((scene.points_m.at(name) - point).norm(), tolerance_m) << name;
  }
  for (std::size_t i = 0; i < expected.cameras.size(); ++i) {
    const Eigen::Vector3d at = scene.cameras[i].camera_from_world.inverse().translation_m;
    const Eigen::Vector3d wanted = expected.cameras[i].camera_from_world.inverse().translation_m;
    EXPECT_LT((at - wanted).norm(), tolerance_m);
  }
}

TEST(SceneFrame, MovingASceneLeavesItsPicturesAlone) {
  Random random(3);
  const Scene before = right_scene(), after = lost_scene(random, 7.5);
  for (std::size_t i = 0; i < before.cameras.size(); ++i) {
    for (const auto& [name, point] : before.points_m) {
      const Eigen::Vector2d pixel = project_world(before.cameras[i], point);
      EXPECT_LT((project_world(after.cameras[i], after.points_m.at(name)) - pixel).norm(), 1e-9);
    }
  }
}

TEST(SceneFrame, KnownPointsGiveScaleAndAxes) {
  Random random(4);
  Scene scene = lost_scene(random, 0.13);
  MarksFile marks;
  marks.points_m = right_scene().points_m;
  marks.points_m.erase("e");
  marks.points_m["elsewhere"] = {5, 5, 5};
  const SceneFrame frame = frame_from_marks(scene, marks);
  EXPECT_TRUE(frame.has_scale && frame.has_axes);
  EXPECT_THAT(frame.text, HasSubstr("4 known points"));
  EXPECT_LT(frame.rms_m, 1e-12);
  move_scene(scene, frame.world_from_scene);
  expect_same(scene, right_scene());
}

TEST(SceneFrame, AxesAndALengthGiveTheSame) {
  Random random(5);
  Scene scene = lost_scene(random, 21.0);
  MarksFile marks;
  marks.lengths = {{"a", "b", 0.3, 1e-4}};
  marks.axes = {"a", "b", "c"};
  const SceneFrame frame = frame_from_marks(scene, marks);
  EXPECT_TRUE(frame.has_scale && frame.has_axes);
  move_scene(scene, frame.world_from_scene);
  expect_same(scene, right_scene());
}

TEST(SceneFrame, LengthsAloneGiveTheScale) {
  Random random(6);
  Scene scene = lost_scene(random, 3.0);
  MarksFile marks;
  marks.lengths = {{"a", "b", 0.3, 1e-4}, {"a", "c", std::sqrt(0.05), 1e-4}};
  const SceneFrame frame = frame_from_marks(scene, marks);
  EXPECT_TRUE(frame.has_scale);
  EXPECT_FALSE(frame.has_axes);
  EXPECT_NEAR(frame.world_from_scene.scale, 1.0 / 3.0, 1e-9);
}

TEST(SceneFrame, WhatIsMissingIsNamed) {
  const Scene scene = right_scene();
  MarksFile marks;
  EXPECT_FALSE(frame_from_marks(scene, marks).has_scale);
  marks.lengths = {{"a", "z", 0.3, 1e-4}};
  EXPECT_THAT([&] { frame_from_marks(scene, marks); },
              ThrowsMessage<InvalidInput>(HasSubstr("'z' has no place")));
  Scene line = scene;
  line.points_m["c"] = {0.6, 0, 0};
  marks.lengths.clear();
  marks.axes = {"a", "b", "c"};
  EXPECT_THAT([&] { frame_from_marks(line, marks); },
              ThrowsMessage<InvalidInput>(HasSubstr("are on a line")));
}

TEST(SceneFrame, MarksArePlacedWherePicturesShowThem) {
  const Scene scene = right_scene();
  std::vector<MarksFile::Photo> photos(3);
  for (std::size_t i = 0; i < photos.size(); ++i) {
    for (const auto& [name, point] : scene.points_m) {
      if (name != "e" || i == 0) photos[i].marks_px[name] = project_world(scene.cameras[i], point);
    }
  }
  const auto placed = place_marks(scene.cameras, photos);
  EXPECT_EQ(placed.size(), 4U);  // one photo alone shows e
  for (const auto& [name, point] : placed) {
    EXPECT_LT((point - scene.points_m.at(name)).norm(), 1e-9) << name;
  }
}

TEST(SceneFrame, ASheetGivesScaleAndAxes) {
  Random random(8);
  const Target sheet = parse_target("chessboard:5x4:0.03");
  Scene scene = right_scene();
  std::vector<Detection> detections(3);
  for (std::size_t i = 0; i < detections.size(); ++i) {
    Detection& detection = detections[i];
    detection.target = sheet;
    detection.ids = point_ids(sheet);
    detection.points_px.resize(2, static_cast<Eigen::Index>(detection.ids.size()));
    for (std::size_t k = 0; k < detection.ids.size(); ++k) {
      detection.points_px.col(static_cast<Eigen::Index>(k)) =
          project_world(scene.cameras[i], point_on_sheet(sheet, detection.ids[k]));
    }
  }
  move_scene(scene, {0.4, random_motion(random)});
  const SceneFrame frame = frame_from_sheet(scene, detections);
  move_scene(scene, frame.world_from_scene);
  expect_same(scene, right_scene());
  detections[0] = detections[1] = {};
  EXPECT_THAT([&] { frame_from_sheet(scene, detections); },
              ThrowsMessage<InvalidInput>(HasSubstr("1 of the photos show the sheet")));
}

}  // namespace
}  // namespace semblance
