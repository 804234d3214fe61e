// Cameras from dots in painted pictures of an object.
#include "semblance/cameras/marker_calibration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "dot_naming.h"
#include "marker_scene.h"
#include "semblance/cameras/dot_tracks.h"
#include "semblance/core/errors.h"
#include "three_point_pose.h"

namespace semblance {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using testing::add_picture;
using testing::clip;
using testing::dotted_head;
using testing::DottedObject;
using testing::focal_sigma;
using ::testing::HasSubstr;
using testing::photos;
using testing::Scene;
using testing::scene_camera;
using testing::view_of;
using testing::wrong_names;

TEST(ThreePointPose, HoldsTheTruth) {
  Random random(3);
  for (int trial = 0; trial < 200; ++trial) {
    const Rigid3 truth{
        quaternion_from_rotation_vector({random.normal(), random.normal(), random.normal()}),
        {random.normal(), random.normal(), random.uniform(4.0, 8.0)}};
    std::array<Vector3d, 3> points, rays;
    for (int k = 0; k < 3; ++k) {
      points[k] = Vector3d(random.normal(), random.normal(), random.normal());
      rays[k] = (truth * points[k]).normalized();
    }
    double least = 1e9;
    const ThreePointPoses found = three_point_poses(points, rays);
    for (int i = 0; i < found.count; ++i) {
      const Rigid3& pose = found.camera_from_object[i];
      for (int k = 0; k < 3; ++k) {
        EXPECT_LT((pose * points[k]).normalized().cross(rays[k]).norm(), 1e-5) << trial;
      }
      least = std::min(least, (pose.translation_m - truth.translation_m).norm() +
                                  pose.rotation.angularDistance(truth.rotation));
    }
    EXPECT_LT(least, 1e-3) << trial;
  }
}

TEST(KnownMarkers, NamesAndFocalLength) {
  for (const std::uint64_t seed : {1}) {
    const Scene scene = photos(seed);
    const MarkerCalibration found =
        calibrate_known_markers(scene.pictures, {"camera"}, scene.object.points(true), {});
    EXPECT_EQ(wrong_names(scene, found), 0);
    EXPECT_EQ(found.adjustment.survey.world_from_target.size(), scene.pictures.size());
    EXPECT_LT(found.adjustment.rms_px, 0.12);
    ASSERT_TRUE(found.adjustment.covariance.has_value());
    EXPECT_NEAR(found.adjustment.survey.cameras[0].focal_px.x(), scene.camera.focal_px.x(),
                4.0 * focal_sigma(found));
  }
}

template <class Solve>
std::string error_of(const Solve& solve) {
  try {
    solve();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "no error";
}

/// A picture of dots where points fall, without painting.
MarkerPicture exact_picture(const Camera& camera, const Rigid3& pose,
                            const std::vector<MarkerPoint>& points, std::size_t shown) {
  MarkerPicture picture;
  picture.name = "exact";
  picture.width = camera.width;
  picture.height = camera.height;
  for (std::size_t i = 0; i < std::min(shown, points.size()); ++i) {
    Dot dot;
    dot.centre_px = project(camera, pose * points[i].position_m);
    dot.major_px = dot.minor_px = 5.0;
    picture.dots.push_back(dot);
  }
  return picture;
}

/// Points on three rings about an axis, `turns` alike.
std::vector<MarkerPoint> rings(int turns) {
  std::vector<MarkerPoint> points;
  for (int ring = 0; ring < 3; ++ring) {
    for (int k = 0; k < turns; ++k) {
      const double angle = 2.0 * std::numbers::pi * k / turns + 0.3 * ring;
      const double radius = 0.05 + 0.01 * ring;
      points.push_back(
          {.name = "r" + std::string(1, static_cast<char>('0' + 10 * ring + k)),
           .position_m = {radius * std::cos(angle), 0.03 * ring, radius * std::sin(angle)}});
    }
  }
  return points;
}

TEST(KnownMarkers, ASymmetricLayoutIsNamed) {
  const Camera camera = Camera::centred(640, 480, 700.0);
  std::vector<MarkerPoint> points = rings(4);
  const Rigid3 pose = view_of({0.3, 0.2, 0.0}, {0.0, 0.0, 0.4});
  const auto solve = [&] {
    calibrate_known_markers({exact_picture(camera, pose, points, 99)}, {"camera"}, points, {});
  };
  EXPECT_THAT(error_of(solve), ::testing::AllOf(HasSubstr("symmetric"), HasSubstr("90 degrees"),
                                                HasSubstr("ambiguous")));
  points[0].position_m.x() += 0.01;
  EXPECT_THAT(error_of(solve), ::testing::Not(HasSubstr("symmetric")));
}

TEST(KnownMarkers, PicturesThatCanBeNamedTwiceAreLeftOut) {
  // Alike after half a turn but for two points, which the picture does not show.
  std::vector<MarkerPoint> points = rings(6);
  points.push_back({.name = "extra", .position_m = {0.0, 0.09, 0.02}});
  points.push_back({.name = "other", .position_m = {0.03, -0.04, 0.0}});
  const Camera camera = Camera::centred(640, 480, 700.0);
  const Rigid3 pose = view_of({0.3, 0.2, 0.0}, {0.0, 0.0, 0.4});
  const auto solve = [&] {
    calibrate_known_markers({exact_picture(camera, pose, points, 18)}, {"camera"}, points, {});
  };
  EXPECT_THAT(error_of(solve), HasSubstr("several ways"));
}

TEST(KnownMarkers, WhatIsMissingIsNamed) {
  Random random(7);
  const DottedObject object = dotted_head(random, 30);
  const std::vector<MarkerPoint> points = object.points(false);
  const Camera camera = Camera::centred(640, 480, 700.0);
  const Rigid3 pose = view_of({0.0, 0.0, 0.0}, {0.0, 0.0, 0.4});
  const auto with_dots = [&](std::size_t shown) {
    return error_of([&] {
      calibrate_known_markers({exact_picture(camera, pose, points, shown)}, {"camera"}, points, {});
    });
  };
  EXPECT_THAT(with_dots(0), HasSubstr("no round dots"));
  EXPECT_THAT(with_dots(5), HasSubstr("5 dots at most"));
  // Another object's dots.
  Random other_random(8);
  const std::vector<MarkerPoint> other = dotted_head(other_random, 30).points(false);
  EXPECT_THAT(error_of([&] {
                calibrate_known_markers({exact_picture(camera, pose, other, 14)}, {"camera"},
                                        points, {});
              }),
              ::testing::AnyOf(HasSubstr("whatever the view"), HasSubstr("several ways")));
  EXPECT_THAT(error_of([&] {
                calibrate_known_markers({exact_picture(camera, pose, points, 30)}, {"camera"},
                                        {points[0], points[1]}, {});
              }),
              HasSubstr("7 or more"));
}

TEST(KnownMarkers, ARigOfTwo) {
  Random random(21);
  Scene left;
  left.object = dotted_head(random, 40);
  left.camera = scene_camera(random, Lens::pinhole);
  Scene right = left;
  const Rigid3 right_from_left{quaternion_from_rotation_vector({0.0, 0.5, 0.05}),
                               {-0.2, 0.01, 0.06}};
  std::vector<MarkerPicture> pictures;
  for (int i = 0; i < 4; ++i) {
    const Rigid3 pose = view_of({random.uniform(-0.4, 0.4), random.uniform(-3.0, 3.0), 0.1},
                                {0.02 * i - 0.02, 0.0, left.camera.focal_px.x() / 640.0 * 0.34});
    add_picture(left, pose, false, {}, static_cast<std::uint64_t>(300 + i));
    add_picture(right, right_from_left * pose, false, {}, static_cast<std::uint64_t>(400 + i));
    right.pictures.back().camera = 1;
    pictures.push_back(left.pictures.back());
    pictures.push_back(right.pictures.back());
  }
  const MarkerCalibration found =
      calibrate_known_markers(pictures, {"left", "right"}, left.object.points(true), {});
  const std::vector<Camera>& cameras = found.adjustment.survey.cameras;
  const Rigid3 link = cameras[1].camera_from_world * cameras[0].camera_from_world.inverse();
  EXPECT_LT((link.translation_m - right_from_left.translation_m).norm(), 2e-3);
  EXPECT_LT(link.rotation.angularDistance(right_from_left.rotation), 3e-3);
  // Without an instant in common there is no link.
  for (MarkerPicture& picture : pictures) picture.instant += 100 * picture.camera;
  EXPECT_THAT(error_of([&] {
                calibrate_known_markers(pictures, {"left", "right"}, left.object.points(true), {});
              }),
              HasSubstr("'right' shares no instant"));
}

TEST(FollowDots, KeepsIdentitiesThroughGaps) {
  const Scene scene = clip(11);
  std::vector<std::vector<Dot>> dots;
  Random random(5);
  for (const MarkerPicture& picture : scene.pictures) {
    dots.push_back(picture.dots);
    // One dot in twenty is missed.
    dots.back().erase(std::remove_if(dots.back().begin(), dots.back().end(),
                                     [&](const Dot&) { return random.uniform() < 0.05; }),
                      dots.back().end());
  }
  const DotTracks tracks = follow_dots(dots);
  std::vector<std::map<int, int>> discs(static_cast<std::size_t>(tracks.count));
  std::size_t sightings = 0;
  for (std::size_t i = 0; i < dots.size(); ++i) {
    for (std::size_t j = 0; j < dots[i].size(); ++j) {
      const int disc =
          testing::disc_at(scene.object, scene.camera, scene.poses[i], dots[i][j].centre_px);
      ++discs[static_cast<std::size_t>(tracks.track_of_dot[i][j])][disc];
      ++sightings;
    }
  }
  for (const auto& of_track : discs) EXPECT_EQ(of_track.size(), 1u);
  // Few tracks per disc: they are not just cut at every doubt.
  EXPECT_GT(static_cast<double>(sightings) / tracks.count, 6.0);
}

/// Distances of all pairs of points against those of the discs they show.
double worst_length_error(const Scene& scene, const MarkerCalibration& found) {
  std::map<int, int> disc_of_point;
  for (std::size_t i = 0; i < found.adjustment.survey.sightings.size(); ++i) {
    disc_of_point[found.adjustment.survey.sightings[i].point] =
        scene.disc_of(found.picture_of_sighting[i], found.dot_of_sighting[i]);
  }
  double worst = 0.0;
  for (const auto& [a, disc_a] : disc_of_point) {
    for (const auto& [b, disc_b] : disc_of_point) {
      const auto at = [](int index) { return static_cast<std::size_t>(index); };
      worst = std::max(
          worst, std::abs((found.points[at(a)].position_m - found.points[at(b)].position_m).norm() -
                          (scene.object.discs[at(disc_a)].centre_m -
                           scene.object.discs[at(disc_b)].centre_m)
                              .norm()));
    }
  }
  return worst;
}

TEST(UnknownMarkers, ShapeAndFocalLength) {
  const Scene scene = clip(100);
  MarkerOptions options;
  options.rough_focal_px = 800.0;  // saves the trial of others
  MarkerCalibration found = calibrate_unknown_markers(scene.pictures, "camera", options);
  // The scale by the distance of two of the dots that were found.
  const Sighting &first = found.adjustment.survey.sightings[0],
                 &other = found.adjustment.survey.sightings[5];
  const auto disc = [&](std::size_t i) {
    return static_cast<std::size_t>(
        scene.disc_of(found.picture_of_sighting[i], found.dot_of_sighting[i]));
  };
  options.length = MarkerLength{
      found.points[static_cast<std::size_t>(first.point)].name,
      found.points[static_cast<std::size_t>(other.point)].name,
      (scene.object.discs[disc(0)].centre_m - scene.object.discs[disc(5)].centre_m).norm()};
  found = calibrate_unknown_markers(scene.pictures, "camera", options);
  EXPECT_GT(found.points.size(), 12u);
  EXPECT_LT(worst_length_error(scene, found), 1.5e-3);
  ASSERT_TRUE(found.adjustment.covariance.has_value());
  EXPECT_LT(found.adjustment.rms_px, 0.15);
  EXPECT_NEAR(found.adjustment.survey.cameras[0].focal_px.x(), scene.camera.focal_px.x(),
              4.0 * focal_sigma(found));
}

TEST(UnknownMarkers, WhatIsMissingIsNamed) {
  const Scene scene = clip(100);
  const auto solve = [](std::vector<MarkerPicture> pictures, const MarkerOptions& options) {
    return error_of([&] { calibrate_unknown_markers(pictures, "camera", options); });
  };
  std::vector<MarkerPicture> pictures = scene.pictures;
  EXPECT_THAT(solve({pictures[0], pictures[1]}, {}), HasSubstr("2 pictures"));
  MarkerOptions length;
  length.rough_focal_px = 800.0;
  length.length = MarkerLength{"d01", "nose", 0.1};
  EXPECT_THAT(solve(pictures, length), HasSubstr("no dot 'nose'"));
  std::vector<MarkerPicture> few = pictures, none = pictures;
  for (MarkerPicture& picture : few) picture.dots.resize(4);
  for (MarkerPicture& picture : none) picture.dots.clear();
  EXPECT_THAT(solve(few, {}), HasSubstr("4 dots at most"));
  EXPECT_THAT(solve(none, {}), HasSubstr("no round dots"));
  // Dots that stay where they are: nothing moves, so that nothing has depth.
  std::vector<MarkerPicture> still(12, pictures[0]);
  EXPECT_NE(solve(still, {}), "no error");
  pictures[3].width = 320;
  EXPECT_THAT(solve(pictures, {}), HasSubstr("320 x 480"));
}

}  // namespace
}  // namespace semblance
