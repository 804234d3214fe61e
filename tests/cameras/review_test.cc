#include "semblance/cameras/review.h"

#include <gmock/gmock.h>

#include "survey_maker.h"

namespace semblance {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Views of a chessboard by two cameras 40 cm apart, with a third of a pixel of noise.
struct Taken {
  std::vector<Camera> cameras;
  std::vector<RigView> views;
};

Taken take_pictures(Random& random, double motion_m = 0.0) {
  const Target sheet = parse_target("chessboard:9x6:0.025");
  Survey survey = sheet_survey(random, Lens::brown5, 20);
  survey.cameras.push_back(survey.cameras[0]);
  survey.cameras[1].camera_from_world = {quaternion_from_rotation_vector({0.0, 0.5, 0.02}),
                                         {-0.2, 0.0, 0.03}};
  survey.cameras[0].name = "left";
  survey.cameras[1].name = "right";
  Taken taken{survey.cameras, {}};
  for (int c = 0; c < 2; ++c) {
    for (int i = 0; i < static_cast<int>(survey.world_from_target.size()); ++i) {
      RigView view;
      view.camera = c;
      view.instant = i;
      view.name = "view";
      const Eigen::Vector3d moved_m = normal_vector(random, motion_m);  // till the right one looked
      view.detection.target = sheet;
      view.detection.ids = point_ids(sheet);
      view.detection.width = survey.cameras[0].width;
      view.detection.height = survey.cameras[0].height;
      view.detection.points_px.resize(2, static_cast<Eigen::Index>(view.detection.ids.size()));
      for (std::size_t k = 0; k < view.detection.ids.size(); ++k) {
        const Eigen::Vector3d point = survey.world_from_target[static_cast<std::size_t>(i)] *
                                          point_on_sheet(sheet, view.detection.ids[k]) +
                                      c * moved_m;
        view.detection.points_px.col(static_cast<Eigen::Index>(k)) =
            project_world(survey.cameras[static_cast<std::size_t>(c)], point) +
            0.3 * Eigen::Vector2d(random.normal(), random.normal());
      }
      taken.views.push_back(std::move(view));
    }
  }
  return taken;
}

TEST(Review, CamerasThatAreRightPass) {
  for (const std::uint64_t seed : {1U, 2U, 3U, 4U, 5U}) {
    Random random(seed);
    const Taken taken = take_pictures(random);
    const CalibrationReview review = review_calibration(taken.views, taken.cameras);
    EXPECT_THAT(review.warnings, IsEmpty()) << seed;
    EXPECT_NEAR(review.cameras[0].rms_px, 0.42, 0.03);
    EXPECT_LT(review.cameras[1].mean_change_px, 4.0 * review.cameras[1].mean_sigma_px);
  }
}

TEST(Review, PicturesOfDifferentTimesBlameNoCamera) {
  Random random(8);
  const Taken taken = take_pictures(random, 4e-3);
  const CalibrationReview review = review_calibration(taken.views, taken.cameras);
  EXPECT_THAT(review.warnings, ElementsAre(HasSubstr("may be of different times")));
  EXPECT_NEAR(*review.refit.fits[1].alone_px, 0.42, 0.03);
  // A lens that changed is still seen.
  Taken zoomed = taken;
  zoomed.cameras[1].focal_px *= 1.02;
  EXPECT_THAT(review_calibration(zoomed.views, zoomed.cameras).warnings,
              ElementsAre(HasSubstr("may be of different times"),
                          HasSubstr("right: the lens has changed")));
}

TEST(Review, ALensThatChangedIsNamed) {
  Random random(6);
  Taken taken = take_pictures(random);
  taken.cameras[1].focal_px *= 1.02;
  const CalibrationReview review = review_calibration(taken.views, taken.cameras);
  EXPECT_THAT(review.warnings, ::testing::Contains(HasSubstr("right: the lens has changed")));
  EXPECT_GT(review.cameras[1].rms_px, review.cameras[1].refit_rms_px);
}

TEST(Review, ACameraThatMovedIsNamed) {
  Random random(7);
  Taken taken = take_pictures(random);
  Rigid3& pose = taken.cameras[1].camera_from_world;
  pose.rotation = quaternion_from_rotation_vector({0.0, 0.01, 0.0}) * pose.rotation;
  const CalibrationReview review = review_calibration(taken.views, taken.cameras);
  EXPECT_THAT(review.warnings, ElementsAre(HasSubstr("right: the camera has moved")));
  EXPECT_NEAR(review.cameras[1].turn_rad, 0.01, 3.0 * review.cameras[1].turn_sigma_rad);
}

}  // namespace
}  // namespace semblance
