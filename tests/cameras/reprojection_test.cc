#include "reprojection.h"

#include <gtest/gtest.h>

#include "semblance/core/random.h"

namespace semblance {
namespace {

Eigen::Vector3d random_vector(Random& random, double size) {
  return {random.uniform(-size, size), random.uniform(-size, size), random.uniform(-size, size)};
}

// Largest difference between the derivative by steps of a block and central differences, relative
// to the derivative's size. Poses step on their manifold, the others by addition.
double derivative_error(const Reprojection& cost, std::vector<const double*> blocks, int block) {
  const auto size = static_cast<std::size_t>(cost.parameter_block_sizes()[block]);
  const bool is_pose = block == block_camera || block == block_placement;
  Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor> jacobian(2, size);
  std::vector<double*> jacobians(block_count, nullptr);
  jacobians[static_cast<std::size_t>(block)] = jacobian.data();
  Eigen::Vector2d residual;
  EXPECT_TRUE(cost.Evaluate(blocks.data(), residual.data(), jacobians.data()));

  const double* start = blocks[static_cast<std::size_t>(block)];
  const Eigen::Index steps = is_pose ? 6 : static_cast<Eigen::Index>(size);
  constexpr double length = 1e-6;
  double worst = 0.0;
  for (Eigen::Index i = 0; i < steps; ++i) {
    const auto moved = [&](double by) {
      std::vector<double> there(start, start + size);
      Eigen::VectorXd step = Eigen::VectorXd::Zero(steps);
      step[i] = by;
      if (is_pose) {
        PoseManifold().Plus(start, step.data(), there.data());
      } else {
        there[static_cast<std::size_t>(i)] += by;
      }
      blocks[static_cast<std::size_t>(block)] = there.data();
      Eigen::Vector2d result;
      EXPECT_TRUE(cost.Evaluate(blocks.data(), result.data(), nullptr));
      return result;
    };
    const Eigen::Vector2d difference = (moved(length) - moved(-length)) / (2.0 * length);
    worst = std::max(worst, (difference - jacobian.col(i)).norm() / (1.0 + difference.norm()));
  }
  return worst;
}

class ReprojectionOf : public ::testing::TestWithParam<Lens> {};

TEST_P(ReprojectionOf, HasTheDerivativesOfDifferences) {
  const Lens lens = GetParam();
  Random random(3);
  for (int trial = 0; trial < 20; ++trial) {
    Camera camera = Camera::centred(640, 480, 500.0);
    camera.focal_px.y() = 510.0;
    camera.lens = lens;
    for (int i = 0; i < coefficient_count(lens); ++i) {
      camera.distortion[static_cast<std::size_t>(i)] = random.uniform(-0.05, 0.05);
    }
    Sighting sighting;
    sighting.pixel_px = {300.0, 200.0};
    sighting.velocity_px_s = {30.0, -20.0};
    sighting.spread = 1.7;
    const Eigen::Vector3d shape(0.3, 0.7, -0.2);
    const Reprojection cost(lens, sighting, shape);

    std::vector<double> intrinsics = intrinsics_block(camera);
    PoseBlock pose = block_from_pose(
        {quaternion_from_rotation_vector(random_vector(random, 0.5)), {0.1, -0.1, 2.0}});
    PoseBlock placement = block_from_pose(
        {quaternion_from_rotation_vector(random_vector(random, 0.5)), random_vector(random, 0.3)});
    Eigen::Vector3d point = random_vector(random, 0.3), warp = random_vector(random, 0.01);
    double offset = random.uniform(-0.02, 0.02);
    const std::vector<const double*> blocks{intrinsics.data(), pose.data(), placement.data(),
                                            point.data(),      warp.data(), &offset};
    for (int block = 0; block < block_count; ++block) {
      EXPECT_LT(derivative_error(cost, blocks, block), 1e-6) << "block " << block;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, ReprojectionOf, ::testing::ValuesIn(all_lenses),
                         [](const auto& tested) { return std::string(lens_name(tested.param)); });

TEST(Reprojection, IsTheSurveysResidual) {
  Survey survey;
  survey.cameras = {Camera::centred(640, 480, 500.0)};
  survey.world_from_target = {
      {quaternion_from_rotation_vector({0.1, 0.2, 0.3}), Eigen::Vector3d(0.0, 0.0, -2.0)}};
  survey.points_m = {{0.0, 0.0, 0.0}, {0.4, 0.1, 0.0}, {0.2, 0.3, 0.0}};
  survey.warp_m = {0.01, -0.02, 0.005};
  survey.time_offset_s = {0.03};
  Sighting sighting;
  sighting.point = 2;
  sighting.pixel_px = {320.0, 200.0};
  sighting.velocity_px_s = {-12.0, 7.0};
  sighting.spread = 2.5;
  survey.sightings = {sighting};

  const Reprojection cost(Lens::pinhole, sighting,
                          warp_shape(survey.points_m[2], points_box(survey)));
  const std::vector<double> intrinsics = intrinsics_block(survey.cameras[0]);
  const PoseBlock camera = block_from_pose(survey.cameras[0].camera_from_world);
  const PoseBlock placement = block_from_pose(survey.world_from_target[0]);
  const double* blocks[] = {intrinsics.data(),    camera.data(),
                            placement.data(),     survey.points_m[2].data(),
                            survey.warp_m.data(), survey.time_offset_s.data()};
  Eigen::Vector2d residual;
  ASSERT_TRUE(cost.Evaluate(blocks, residual.data(), nullptr));
  EXPECT_LT((2.5 * residual - residual_px(survey, sighting)).norm(), 1e-12);
}

TEST(Reprojection, RefusesAPointBehindTheCamera) {
  const Reprojection cost(Lens::pinhole, Sighting{}, Eigen::Vector3d::Zero());
  const std::vector<double> intrinsics{500.0, 1.0, 320.0, 240.0};
  const PoseBlock identity = block_from_pose({});
  const double point[3] = {0.1, 0.1, -1.0}, warp[3] = {}, offset = 0.0;
  const double* blocks[] = {
      intrinsics.data(), identity.data(), identity.data(), point, warp, &offset};
  Eigen::Vector2d residual;
  EXPECT_FALSE(cost.Evaluate(blocks, residual.data(), nullptr));
}

TEST(PoseManifold, MinusUndoesPlus) {
  const PoseManifold manifold;
  const PoseBlock pose = block_from_pose(
      {quaternion_from_rotation_vector({0.4, -0.3, 1.2}), Eigen::Vector3d(1.0, 2.0, 3.0)});
  const Eigen::Matrix<double, 6, 1> step =
      (Eigen::Matrix<double, 6, 1>() << 0.3, -0.2, 0.5, 0.1, 0.2, -0.4).finished();
  PoseBlock moved;
  Eigen::Matrix<double, 6, 1> found;
  manifold.Plus(pose.data(), step.data(), moved.data());
  manifold.Minus(moved.data(), pose.data(), found.data());
  EXPECT_LT((found - step).norm(), 1e-12);
}

}  // namespace
}  // namespace semblance
