#include "semblance/cameras/judge.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "projection_map.h"
#include "survey_maker.h"

namespace semblance {
namespace {

using ::testing::Each;
using ::testing::HasSubstr;

std::vector<Eigen::Vector2d> cell_centres(const Camera& camera, int rows, int columns) {
  std::vector<Eigen::Vector2d> centres;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      centres.emplace_back((column + 0.5) * camera.width / columns,
                           (row + 0.5) * camera.height / rows);
    }
  }
  return centres;
}

// How far `other` shows the directions of `camera`'s pixels from there, once `other` is turned for
// the best agreement. By true projections, without derivatives of the lens.
Eigen::Matrix2Xd shifts(const Camera& camera, const Camera& other,
                        const std::vector<Eigen::Vector2d>& pixels) {
  const auto count = static_cast<Eigen::Index>(pixels.size());
  const auto shifts_turned = [&](const Eigen::Vector3d& turn) {
    Eigen::Matrix2Xd result(2, count);
    const Eigen::Quaterniond rotation = quaternion_from_rotation_vector(turn);
    for (Eigen::Index i = 0; i < count; ++i) {
      const Eigen::Vector2d& pixel = pixels[static_cast<std::size_t>(i)];
      result.col(i) = project(other, rotation * unproject(camera, pixel)) - pixel;
    }
    return result;
  };
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
  for (int round = 0; round < 4; ++round) {
    const Eigen::Matrix2Xd at = shifts_turned(turn);
    Eigen::MatrixXd jacobian(2 * count, 3);
    constexpr double step = 1e-6;
    for (int k = 0; k < 3; ++k) {
      const Eigen::Matrix2Xd moved = shifts_turned(turn + step * Eigen::Vector3d::Unit(k));
      jacobian.col(k) = ((moved - at) / step).reshaped();
    }
    turn -= jacobian.colPivHouseholderQr().solve(at.reshaped());
  }
  return shifts_turned(turn);
}

TEST(ProjectionMap, AgreesWithCamerasDrawnAtRandom) {
  Random random(21);
  Survey survey = sheet_survey(random, Lens::brown5, 15);
  add_sightings(survey, random, 0.2);
  const Adjustment found = adjust(survey, one_camera());
  ASSERT_TRUE(found.covariance.has_value());
  const Camera& camera = found.survey.cameras[0];
  const Eigen::MatrixXd& covariance = found.covariance->cameras[0].intrinsics;
  const Eigen::MatrixXd root = covariance.llt().matrixL();

  constexpr int rows = 3, columns = 4, draws = 1500;
  const std::vector<Eigen::Vector2d> pixels = cell_centres(camera, rows, columns);
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(rows * columns);
  for (int draw = 0; draw < draws; ++draw) {
    Eigen::VectorXd normal(covariance.rows());
    for (double& x : normal) x = random.normal();
    const Eigen::VectorXd change = root * normal;
    Camera other = camera;
    other.focal_px += change.head<2>();
    other.principal_px += change.segment<2>(2);
    for (int k = 0; k < 5; ++k) other.distortion[static_cast<std::size_t>(k)] += change[4 + k];
    squares += 0.5 * shifts(camera, other, pixels).colwise().squaredNorm().transpose();
  }
  const Eigen::MatrixXd sigma_px = ProjectionMap(camera, rows, columns).sigma_px(covariance);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const double expected = std::sqrt(squares[row * columns + column] / draws);
      // The deviation of a deviation from so many draws of two figures is under 2 %.
      EXPECT_NEAR(sigma_px(row, column) / expected, 1.0, 0.06) << row << ", " << column;
    }
  }
}

TEST(ProjectionMap, ATurnOfTheCameraIsNoUncertainty) {
  Camera camera = Camera::centred(640, 480, 4000.0);  // so long that turns and shifts are one
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(4, 4);
  covariance(2, 2) = 25.0;  // the principal point, by 5 px
  EXPECT_LT(ProjectionMap(camera, 6, 8).sigma_px(covariance).maxCoeff(), 0.05);
}

TEST(Judge, ViewsLeftOutFitLikeTheOthersWhereTheModelIsRight) {
  Random random(22);
  Survey survey = sheet_survey(random, Lens::brown2, 20);
  add_sightings(survey, random, 0.3);
  const Verdict verdict = judge(adjust(survey, one_camera()), silent_progress());
  const CameraVerdict& camera = verdict.cameras[0];
  EXPECT_EQ(camera.held_out + 2 * camera.outliers, camera.sightings + camera.outliers);
  // Of a sheet placed by half of its points, errors are larger by about 6 / 54.
  EXPECT_NEAR(camera.held_out_px, std::sqrt(2.0) * 0.3, 0.04);
  EXPECT_GE(camera.held_out_px, camera.rms_px);
}

TEST(Judge, ALensThatFollowsItsPicturesIsFoundOut) {
  Random random(23);
  Survey survey = sheet_survey(random, Lens::pinhole, 10);
  survey.cameras[0].lens = Lens::brown8;
  for (Rigid3& pose : survey.world_from_target) {  // few small sheets in the middle
    pose.translation_m.z() += 1.2;
  }
  add_sightings(survey, random, 0.5);
  const Adjustment found = adjust(survey, one_camera());
  const Verdict verdict = judge(found, silent_progress());
  EXPECT_LT(verdict.cameras[0].coverage, 0.3);
  EXPECT_THAT(verdict.warnings, ::testing::Contains(HasSubstr("of the picture only")));
}

TEST(Judge, CountsWhereTheSheetWasSeen) {
  Random random(24);
  Survey survey = sheet_survey(random, Lens::brown2, 12);
  add_sightings(survey, random, 0.1);
  const Adjustment found = adjust(survey, one_camera());
  const CameraVerdict verdict = judge(found, silent_progress()).cameras[0];
  Eigen::MatrixXi counts = Eigen::MatrixXi::Zero(verdict_rows, verdict_columns);
  for (std::size_t i = 0; i < found.survey.sightings.size(); ++i) {
    const Eigen::Vector2d& pixel = found.survey.sightings[i].pixel_px;
    if (found.outlier[i] || pixel.x() < 0 || pixel.y() < 0 || pixel.x() >= 640 ||
        pixel.y() >= 480) {
      continue;
    }
    ++counts(static_cast<int>(pixel.y() / 480.0 * verdict_rows),
             static_cast<int>(pixel.x() / 640.0 * verdict_columns));
  }
  // Points beyond the picture's edge count in the outermost cells.
  EXPECT_TRUE((verdict.counts.array() >= counts.array()).all());
  EXPECT_EQ(verdict.counts.block(1, 1, 7, 14), counts.block(1, 1, 7, 14));
}

TEST(Judge, TheNextViewHelpsAsMuchAsItSays) {
  Random random(25);
  Survey survey = sheet_survey(random, Lens::brown5, 6);
  add_sightings(survey, random, 0.2);
  AdjustmentOptions options = one_camera();
  options.outlier_sigmas.reset();
  const Adjustment before = adjust(survey, options);
  const Verdict verdict = judge(before, silent_progress());
  ASSERT_TRUE(verdict.cameras[0].next.has_value());
  const NextView& next = *verdict.cameras[0].next;
  EXPECT_LT(next.mean_sigma_after_px, 0.9 * next.mean_sigma_before_px);

  Survey more = before.survey;
  more.world_from_target.push_back(next.camera_from_sheet);
  const int placement = static_cast<int>(more.world_from_target.size()) - 1;
  for (int k = 0; k < static_cast<int>(more.points_m.size()); ++k) {
    Sighting sighting{0, placement, k};
    sighting.pixel_px = residual_px(more, sighting) +
                        before.sigma_px * Eigen::Vector2d(random.normal(), random.normal());
    more.sightings.push_back(sighting);
  }
  const Adjustment after = adjust(more, options);
  ASSERT_TRUE(after.covariance.has_value());
  const double sigma_px = ProjectionMap(after.survey.cameras[0], verdict_rows, verdict_columns)
                              .mean_sigma_px(after.covariance->cameras[0].intrinsics) *
                          before.sigma_px / after.sigma_px;  // as if the noise had come out alike
  EXPECT_NEAR(sigma_px / next.mean_sigma_after_px, 1.0, 0.15);
}

// Two cameras that look at the sheet from the left and the right.
Survey stereo_survey(Random& random) {
  Survey survey = sheet_survey(random, Lens::brown2, 12);
  survey.cameras.push_back(survey.cameras[0]);
  survey.cameras[0].name = "left";
  survey.cameras[1].name = "right";
  const Eigen::Quaterniond turn = quaternion_from_rotation_vector(Eigen::Vector3d(0.0, 0.35, 0.0));
  survey.cameras[1].camera_from_world = {turn, Eigen::Vector3d(-0.15, 0.0, 0.03)};
  return survey;
}

TEST(Judge, MeasuresLengthsByRays) {
  Random random(26);
  Survey survey = stereo_survey(random);
  add_sightings(survey, random, 0.05);
  AdjustmentOptions options;
  options.cameras = {CameraFreedom::none(), CameraFreedom::none()};
  const Verdict right = judge(adjust(survey, options), silent_progress());
  ASSERT_TRUE(right.lengths.has_value());
  EXPECT_NEAR(right.lengths->scale_error, 0.0, 2e-3);

  // Cameras 2 % further apart than they were: lengths come out as much too long.
  survey.cameras[1].camera_from_world.translation_m *= 1.02;
  options.outlier_sigmas.reset();
  const Verdict wrong = judge(adjust(survey, options), silent_progress());
  ASSERT_TRUE(wrong.lengths.has_value());
  EXPECT_NEAR(wrong.lengths->scale_error - right.lengths->scale_error, 0.02, 2e-3);
}

}  // namespace
}  // namespace semblance
