// A camera meets pictures of another size: what is said, and where things then are.
#include "semblance/io/picture_size.h"

#include <gmock/gmock.h>

#include <opencv2/imgproc.hpp>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

Camera camera_of(int width, int height) {
  Camera camera = Camera::centred(width, height, 150.0);
  camera.camera_from_world = {};
  camera.principal_px += Eigen::Vector2d(3.0, -5.0);
  camera.name = "left";
  return camera;
}

Rgb8 picture_of(const cv::Mat& grey) {
  Rgb8 picture{grey.cols, grey.rows, {}};
  for (const std::uint8_t value : cv::Mat_<std::uint8_t>(grey)) {
    picture.data.insert(picture.data.end(), 3, value);
  }
  return picture;
}

/// A grey wall with a white spot where the camera sees a point.
cv::Mat wall_with_spot(const Camera& camera, const Eigen::Vector3d& point_m) {
  const Eigen::Vector2d at = project(camera, point_m);
  cv::Mat wall(camera.height, camera.width, CV_8U);
  for (int y = 0; y < wall.rows; ++y) {
    for (int x = 0; x < wall.cols; ++x) {
      const double square = (Eigen::Vector2d(x + 0.5, y + 0.5) - at).squaredNorm();
      wall.at<std::uint8_t>(y, x) =
          cv::saturate_cast<std::uint8_t>(100.0 + 150.0 * std::exp(-0.5 * square / 9.0));
    }
  }
  return wall;
}

Eigen::Vector2d spot_in(const cv::Mat& picture) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double weight = 0.0;
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) {
      const double bright = std::max(0, picture.at<std::uint8_t>(y, x) - 102);
      sum += bright * Eigen::Vector2d(x + 0.5, y + 0.5);
      weight += bright;
    }
  }
  return sum / weight;
}

std::string refusal(const Camera& camera, int width, int height) {
  try {
    require_camera_size(camera, width, height, "clip.mp4");
  } catch (const InvalidInput& error) {
    return error.what();
  }
  return "";
}

TEST(PictureSize, NamesTheDifference) {
  struct Case {
    int width, height;
    SizeDifference difference;
  };
  const Camera camera = camera_of(1920, 1088);
  for (const Case& c : {Case{1920, 1088, SizeDifference::none},
                        {1920, 1080, SizeDifference::padded},
                        {1088, 1920, SizeDifference::turned},
                        {960, 544, SizeDifference::scaled},
                        {1280, 720, SizeDifference::other},
                        {1920, 1072, SizeDifference::other}}) {
    EXPECT_EQ(size_difference(camera, c.width, c.height), c.difference) << c.width << c.height;
  }
  EXPECT_EQ(size_difference(camera_of(1080, 1920), 1088, 1920), SizeDifference::padded);
  EXPECT_EQ(size_difference(camera_of(1920, 1080), 1280, 720), SizeDifference::scaled);
}

TEST(PictureSize, RefusesWithSizesAndRemedy) {
  const Camera camera = camera_of(1920, 1080);
  EXPECT_EQ(refusal(camera, 1920, 1080), "");
  EXPECT_THAT(refusal(camera, 1080, 1920), AllOf(HasSubstr("clip.mp4"), HasSubstr("'left'"),
                                                 HasSubstr("1080 x 1920"), HasSubstr("its side")));
  EXPECT_THAT(refusal(camera, 1920, 1088), HasSubstr("blocks of 16"));
  EXPECT_THAT(refusal(camera, 1280, 720), HasSubstr("the scale is not"));
  EXPECT_THAT(refusal(camera, 640, 480), HasSubstr("one size alone"));
}

TEST(PictureSize, BarsAreThin) {
  cv::Mat grey(200, 100, CV_8U, cv::Scalar(90));
  grey.rowRange(0, 7).setTo(12);
  grey.rowRange(194, 200).setTo(30);
  grey.colRange(97, 100).setTo(0);
  const BlackBars bars = black_bars(picture_of(grey));
  EXPECT_EQ(bars.top, 7);
  EXPECT_EQ(bars.bottom, 6);
  EXPECT_EQ(bars.left, 0);
  EXPECT_EQ(bars.right, 3);
  grey.rowRange(0, 60).setTo(10);  // dark ceiling
  EXPECT_EQ(black_bars(picture_of(grey)).top, 0);
  grey.setTo(0);
  EXPECT_FALSE(black_bars(picture_of(grey)).any());
}

TEST(PictureSize, FollowsAPictureThatWasScaledBetweenBars) {
  const Camera camera = camera_of(80, 160);
  for (const Eigen::Vector3d& point : {Eigen::Vector3d(0.1, 0.2, 1.0), {-0.12, -0.25, 1.0}}) {
    cv::Mat small, picture;
    cv::resize(wall_with_spot(camera, point), small, {72, 144}, 0, 0, cv::INTER_AREA);
    cv::copyMakeBorder(small, picture, 8, 8, 0, 0, cv::BORDER_CONSTANT, cv::Scalar(0));
    std::vector<std::string> notes;
    const Camera found = camera_for_pictures(camera, picture_of(picture), "clip.mp4", notes);
    EXPECT_EQ(found.width, 72);
    EXPECT_LT((project(found, point) - spot_in(picture)).norm(), 0.05);
    ASSERT_EQ(notes.size(), 1u);
    EXPECT_THAT(notes[0], AllOf(HasSubstr("72 x 160"), HasSubstr("80 x 160"),
                                HasSubstr("black bars"), HasSubstr("0.9000")));
  }
}

TEST(PictureSize, KeepsPlacesWhereTheFillingIsCutOff) {
  const Camera camera = camera_of(80, 160);
  const Eigen::Vector3d point(0.1, 0.2, 1.0);
  const cv::Mat picture = wall_with_spot(camera, point).colRange(0, 72).clone();
  std::vector<std::string> notes;
  const Camera found = camera_for_pictures(camera, picture_of(picture), "clip.mp4", notes);
  EXPECT_EQ(found.width, 72);
  EXPECT_EQ(found.height, 160);
  EXPECT_LT((project(found, point) - spot_in(picture)).norm(), 0.05);
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_THAT(notes[0], AllOf(HasSubstr("blocks of 16"), HasSubstr("10.0 %")));
}

TEST(PictureSize, SaysNothingWhereNothingDiffers) {
  const Camera camera = camera_of(80, 160);
  std::vector<std::string> notes;
  const cv::Mat picture = wall_with_spot(camera, {0.0, 0.0, 1.0});
  EXPECT_EQ(camera_for_pictures(camera, picture_of(picture), "clip.mp4", notes).focal_px,
            camera.focal_px);
  EXPECT_TRUE(notes.empty());
  EXPECT_THROW(camera_for_pictures(camera, picture_of(picture.t()), "clip.mp4", notes),
               InvalidInput);
}

}  // namespace
}  // namespace semblance
