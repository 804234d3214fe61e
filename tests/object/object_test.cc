#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "object_objective.h"
#include "object_scene.h"
#include "semblance/core/errors.h"
#include "semblance/core/parallel.h"
#include "semblance/cost/contour.h"
#include "semblance/object/object_report.h"

namespace semblance::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

Mesh box_mesh() {
  Mesh mesh;
  mesh.positions_m.resize(8, 3);
  for (int v = 0; v < 8; ++v) {
    mesh.positions_m.row(v) << 0.1 * (v & 1), 0.2 * (v >> 1 & 1), 0.3 * (v >> 2);
  }
  mesh.triangles.resize(12, 3);
  mesh.triangles << 0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4, 2, 6, 3, 3, 6, 7, 0, 4, 2,
      2, 4, 6, 1, 3, 5, 3, 7, 5;
  return mesh;
}

double area_m2(const Mesh& mesh) {
  double sum = 0.0;
  for (Eigen::Index t = 0; t < mesh.triangle_count(); ++t) {
    const auto corner = mesh.triangles.row(t);
    const Eigen::Vector3d a = mesh.positions_m.row(corner[0]), b = mesh.positions_m.row(corner[1]),
                          c = mesh.positions_m.row(corner[2]);
    sum += 0.5 * (b - a).cross(c - a).norm();
  }
  return sum;
}

std::string error_of(const std::function<void()>& body) {
  try {
    body();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "no error";
}

TEST(ObjectTarget, DividesLongEdgesWithoutCracks) {
  const ObjectTarget target = make_object_target(box_mesh(), {}, "box");
  EXPECT_NEAR(area_m2(target.mesh), 2.0 * (0.02 + 0.03 + 0.06), 1e-12);
  EXPECT_TRUE(target.centre_m.isApprox(Eigen::Vector3d(0.05, 0.1, 0.15)));
  double longest_m = 0.0;
  for (Eigen::Index t = 0; t < target.mesh.triangle_count(); ++t) {
    for (int k = 0; k < 3; ++k) {
      const int a = target.mesh.triangles(t, k), b = target.mesh.triangles(t, (k + 1) % 3);
      longest_m = std::max(
          longest_m, (target.mesh.positions_m.row(a) - target.mesh.positions_m.row(b)).norm());
    }
  }
  EXPECT_LE(longest_m, target.size_m / 40.0 + 1e-12);
  // Every edge of a closed surface lies between two triangles.
  const std::vector<float> all(static_cast<std::size_t>(target.welded.vertex_count), 1.0f);
  EXPECT_EQ(std::ssize(contour_edges(target.welded, all)), target.welded.edge_count);
  EXPECT_EQ(2 * target.welded.edge_count, 3 * std::ssize(target.welded.triangles));
}

TEST(ObjectTarget, SeamsOfTheTextureAreNoEdgesOfTheSurface) {
  const ObjectTarget target = make_object_target(lump_mesh(), {}, "lump");
  EXPECT_EQ(2 * target.welded.edge_count, 3 * std::ssize(target.welded.triangles));
  EXPECT_GT(target.topology.edge_count, target.welded.edge_count);
}

TEST(ObjectTarget, RefusesWhatItCannotUse) {
  Mesh turned = box_mesh();
  turned.triangles.col(1).swap(turned.triangles.col(2));
  EXPECT_THAT(error_of([&] { make_object_target(turned, {}, "box.obj"); }),
              AllOf(HasSubstr("box.obj"), HasSubstr("inside out")));
  EXPECT_THAT(error_of([&] { make_object_target(box_mesh(), Image(8, 8, 3), "box.obj"); }),
              HasSubstr("no texture coordinates"));
  Mesh empty = box_mesh();
  empty.triangles.resize(0, 3);
  EXPECT_THAT(error_of([&] { make_object_target(empty, {}, "box.obj"); }),
              HasSubstr("no triangles"));
}

TEST(PointMotion, FollowsDifferences) {
  Camera camera = test_camera(700.0);
  camera.focal_px.y() = 720.0;
  camera.lens = Lens::brown5;
  camera.distortion = {-0.2, 0.05, 0.003, -0.002, 0.01};
  const IntrinsicsFreedom freedom{.focal = true, .principal = true, .distortion = true};
  const Rigid3 pose{Eigen::Quaterniond(0.7, 0.3, -0.5, 0.2).normalized(), {0.1, -0.05, 0.9}};
  const Eigen::Vector3d point(0.08, -0.11, 0.06);
  const PointMotion motion = point_motion(camera, freedom, pose, point);
  const auto pixel = [&](const Eigen::VectorXd& d) {
    Camera moved = camera;
    moved.focal_px += d[0] * Eigen::Vector2d(1.0, camera.focal_px.y() / camera.focal_px.x());
    moved.principal_px += d.segment<2>(1);
    for (int k = 0; k < 5; ++k) moved.distortion[static_cast<std::size_t>(k)] += d[3 + k];
    const Rigid3 place{quaternion_from_rotation_vector(d.segment<3>(8)) * pose.rotation,
                       pose.translation_m + d.tail<3>()};
    return project(moved, place * point);
  };
  EXPECT_TRUE(motion.pixel_px.isApprox(pixel(Eigen::VectorXd::Zero(14)), 1e-12));
  ASSERT_EQ(motion.by_parameters.cols(), 14);
  constexpr double step = 1e-6;
  for (int k = 0; k < 14; ++k) {
    const Eigen::VectorXd d = step * Eigen::VectorXd::Unit(14, k);
    const Eigen::Vector2d slope = (pixel(d) - pixel(-d)) / (2.0 * step);
    EXPECT_TRUE(motion.by_parameters.col(k).isApprox(slope, 1e-5)) << k;
  }
}

const Image& texture() {
  static const Image image = blotted_texture(512, 300, 0.06, 5);
  return image;
}

/// One picture, and what is to be found in it.
struct Trial {
  Camera camera;
  Rigid3 pose;
  std::vector<ObjectPicture> pictures;
};
Trial trial_of(const ObjectScene& scene, std::uint64_t seed) {
  Random random(seed);
  Trial out;
  out.camera = test_camera(random.uniform(400.0, 800.0), 480, 360);
  out.pose = random_pose(out.camera, 0.24, 0.65, random);
  out.pictures = {scene.picture(out.camera, out.pose, seed)};
  return out;
}

TEST(CalibrateObject, ColoursAndOutlineBeatClicks) {
  const ObjectScene scene(lump_mesh(), texture(), {});
  const ObjectTarget target = make_object_target(scene.mesh(), scene.texture(), "lump");
  for (const std::uint64_t seed : {11, 12}) {
    const Trial trial = trial_of(scene, seed);
    const ObjectCalibration found = calibrate_object(target, trial.pictures, {});
    const ObjectErrors before = errors_of(found.from_pairs, 0, trial.pose, trial.camera);
    const ObjectErrors after = errors_of(*found.refined, 0, trial.pose, trial.camera);
    EXPECT_LT(after.turn_deg, 0.15 * before.turn_deg);
    EXPECT_LT(after.turn_deg, 0.2);
    EXPECT_LT(std::abs(after.focal_share), 0.02);
    for (const double z : after.z) EXPECT_LT(std::abs(z), 5.0);
  }
}

TEST(CalibrateObject, OutlineAloneBeatsClicksOnAnUntexturedObject) {
  const ObjectScene scene(lump_mesh(), {}, {.textured = false});
  const ObjectTarget target = make_object_target(scene.mesh(), {}, "lump");
  const Trial trial = trial_of(scene, 21);
  ObjectOptions options;
  options.camera = trial.camera;
  const ObjectCalibration found = calibrate_object(target, trial.pictures, options);
  const ObjectErrors before = errors_of(found.from_pairs, 0, trial.pose, trial.camera);
  const ObjectErrors after = errors_of(*found.refined, 0, trial.pose, trial.camera);
  EXPECT_LT(after.place_mm, 0.5 * before.place_mm);
  EXPECT_LT(after.turn_deg, 1.5);
  EXPECT_EQ(found.refined->camera.focal_px, trial.camera.focal_px);
  EXPECT_FALSE(found.refined->focal_free);
  EXPECT_GT(found.fits[0].outline_share, 0.6);
}

TEST(CalibrateObject, TheSameWhateverTheNumberOfThreads) {
  const ObjectScene scene(lump_mesh(48, 32), texture(), {});
  const ObjectTarget target = make_object_target(scene.mesh(), scene.texture(), "lump");
  const Trial trial = trial_of(scene, 31);
  const auto solve = [&](int threads) {
    set_thread_count(threads);
    const ObjectCalibration found = calibrate_object(target, trial.pictures, {});
    set_thread_count(0);
    return found;
  };
  const ObjectCalibration one = solve(1), three = solve(3);
  EXPECT_EQ(one.refined->camera.focal_px, three.refined->camera.focal_px);
  EXPECT_EQ(one.refined->poses[0].covariance, three.refined->poses[0].covariance);
}

TEST(CalibrateObject, FourPairsKeepTheFocalLengthAndSaySo) {
  const ObjectScene scene(lump_mesh(48, 32), texture(), {.click_px = 1.0, .pairs = 4});
  const ObjectTarget target = make_object_target(scene.mesh(), {}, "lump");
  Trial trial = trial_of(scene, 33);
  ObjectOptions options;
  options.refine = false;
  const ObjectCalibration found = calibrate_object(target, trial.pictures, options);
  EXPECT_FALSE(found.from_pairs.focal_free);
  EXPECT_FALSE(found.refined);
  ASSERT_EQ(found.notes.size(), 1u);
  EXPECT_THAT(found.notes[0], HasSubstr("do not tell the focal length"));
  trial.pictures[0].pairs.pop_back();
  EXPECT_THAT(error_of([&] { calibrate_object(target, trial.pictures, options); }),
              AllOf(HasSubstr("picture33"), HasSubstr("needs 4 pairs")));
}

TEST(CalibrateObject, SaysWhereTheObjectIsNot) {
  const ObjectScene scene(lump_mesh(48, 32), texture(), {.click_px = 0.5});
  const ObjectTarget target = make_object_target(scene.mesh(), scene.texture(), "lump");
  const Trial trial = trial_of(scene, 41);
  ObjectOptions options;
  options.camera = trial.camera;

  std::vector<ObjectPicture> outside = trial.pictures;
  for (ObjectPair& pair : outside[0].pairs) pair.pixel_px.x() += 2000.0;
  EXPECT_THAT(error_of([&] { calibrate_object(target, outside, options); }),
              AllOf(HasSubstr("not in the picture"), HasSubstr("picture41")));

  std::vector<ObjectPicture> blank = trial.pictures;
  blank[0].linear = Image(480, 360, 3, 0.4f);
  EXPECT_THAT(error_of([&] { calibrate_object(target, blank, options); }),
              AllOf(HasSubstr("outline was not found"), HasSubstr("picture41")));

  std::vector<ObjectPicture> two = {trial.pictures[0], trial.pictures[0]};
  two[1].linear = Image(360, 480, 3, 0.4f);
  EXPECT_THAT(error_of([&] { calibrate_object(target, two, options); }),
              HasSubstr("pictures of one camera must be of one size"));
}

TEST(ObjectOverlay, DrawsTheOutlineWhereTheObjectIs) {
  const ObjectScene scene(lump_mesh(48, 32), texture(), {.clutter = false, .mask = true});
  const ObjectTarget target = make_object_target(scene.mesh(), {}, "lump");
  const Trial trial = trial_of(scene, 51);
  ObjectEstimate truth;
  truth.camera = trial.camera;
  truth.poses.resize(1);
  truth.poses[0].camera_from_object = trial.pose;
  const Rgb8 plain = rgb8_from_linear(trial.pictures[0].linear);
  const Rgb8 drawn = object_overlay(target, trial.pictures[0], truth, 0);
  const Image& mask = trial.pictures[0].mask;
  // The picture is untouched beside the object; its border is drawn.
  int touched_beside = 0, border = 0, drawn_border = 0;
  for (int y = 2; y < mask.height - 2; ++y) {
    for (int x = 2; x < mask.width - 2; ++x) {
      const bool inside = mask.pixel(x, y)[0] > 0.5f;
      const std::size_t at = std::size_t{3} * (y * mask.width + x);
      const bool touched = !std::equal(&plain.data[at], &plain.data[at] + 3, &drawn.data[at]);
      const bool near = mask.pixel(x + 2, y)[0] > 0.5f || mask.pixel(x - 2, y)[0] > 0.5f ||
                        mask.pixel(x, y + 2)[0] > 0.5f || mask.pixel(x, y - 2)[0] > 0.5f;
      bool marked = false;
      for (const ObjectPair& pair : trial.pictures[0].pairs) {
        marked = marked || (pair.pixel_px - Eigen::Vector2d(x, y)).norm() < 20.0;
      }
      if (!inside && !near && !marked) touched_beside += touched;
      if (inside && mask.pixel(x + 1, y)[0] < 0.5f) {
        ++border;
        drawn_border += touched;
      }
    }
  }
  EXPECT_EQ(touched_beside, 0);
  EXPECT_GT(border, 100);
  EXPECT_GT(drawn_border, 0.95 * border);
}

}  // namespace
}  // namespace semblance::testing
