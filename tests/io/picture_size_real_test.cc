// A calibration for 1088 x 1920 and videos of 1080 x 1920, recorded by cameras that stood still.
#include "semblance/io/picture_size.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "semblance/io/camera_formats.h"
#include "semblance/io/image_io.h"
#include "support.h"

namespace semblance {
namespace {

cv::Mat grey_of(const Rgb8& picture) {
  const cv::Mat rgb(picture.height, picture.width, CV_8UC3,
                    const_cast<std::uint8_t*>(picture.data.data()));
  cv::Mat grey;
  cv::cvtColor(rgb, grey, cv::COLOR_RGB2GRAY);
  return grey;
}

// How far patches of the still, of the calibration's size, are in the video from where the camera
// made for the video puts them; only patches that are found beyond doubt.
std::vector<double> distances_px(const Camera& given, const Camera& found, const cv::Mat& still,
                                 const cv::Mat& frame) {
  constexpr int half = 24, reach = 16;
  std::vector<double> distances;
  for (int y = 60; y + 60 < still.rows; y += 40) {
    for (int x = 60; x + 60 < still.cols; x += 40) {
      const Eigen::Vector2d place(x + 0.5, y + 0.5);
      const Eigen::Vector3d ray = unproject(given, place);
      const Eigen::Vector2d expected = project(found, ray);
      const cv::Rect patch(x - half, y - half, 2 * half + 1, 2 * half + 1);
      const cv::Point corner(static_cast<int>(expected.x()) - half - reach,
                             static_cast<int>(expected.y()) - half - reach);
      const cv::Rect window(corner, cv::Size(patch.width + 2 * reach, patch.height + 2 * reach));
      if ((window & cv::Rect(0, 0, frame.cols, frame.rows)) != window) continue;
      cv::Mat score;
      cv::matchTemplate(frame(window), still(patch), score, cv::TM_CCOEFF_NORMED);
      double best = 0.0;
      cv::Point at;
      cv::minMaxLoc(score, nullptr, &best, nullptr, &at);
      if (best < 0.97) continue;
      const Eigen::Vector2d seen(corner.x + at.x + half + 0.5, corner.y + at.y + half + 0.5);
      distances.push_back((seen - expected).norm());
    }
  }
  std::sort(distances.begin(), distances.end());
  return distances;
}

TEST(PictureSize, TheCalibrationFollowsVideosWithThinBars) {
  SEMBLANCE_NEED_DATA("body/beam-4cam");
  const auto folder = testing::data_path("body/beam-4cam");
  const std::string file = (folder / "calibration/Calib.qca.txt").string();
  for (const Camera& camera : read_cameras(file, *find_camera_format("qualisys")).rig.cameras) {
    Rgb8 frame;
    VideoSource((folder / "videos" / (camera.name + ".mp4")).string()).next(frame);
    std::vector<std::string> notes;
    const Camera found = camera_for_pictures(camera, frame, camera.name, notes);
    const bool has_bars = frame.width == 1080;
    EXPECT_EQ(notes.size(), has_bars ? 1u : 0u) << camera.name;
    if (has_bars) {
      EXPECT_THAT(notes[0], ::testing::HasSubstr("black bars"));
    }
    const cv::Mat still = grey_of(
        read_image_rgb8((folder / "calibration/extrinsics" / (camera.name + "_ext.png")).string()));
    const std::vector<double> distances = distances_px(camera, found, still, grey_of(frame));
    ASSERT_GT(distances.size(), 50u) << camera.name;
    EXPECT_LT(distances[distances.size() / 2], 1.0) << camera.name;
    RecordProperty(camera.name + "_median_px", std::to_string(distances[distances.size() / 2]));
    Camera unchanged = camera;
    unchanged.width = frame.width;
    const std::vector<double> wrong = distances_px(camera, unchanged, still, grey_of(frame));
    if (has_bars) {
      EXPECT_GT(wrong[wrong.size() / 2], 2.0) << camera.name;
    }
  }
}

}  // namespace
}  // namespace semblance
