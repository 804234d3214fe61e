// `semblance sweep animate` from the outside.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "program.h"
#include "semblance/io/image_io.h"
#include "semblance/io/json_file.h"
#include "semblance/io/lip_markers.h"
#include "semblance/io/video.h"
#include "semblance/io/visemes.h"
#include "support.h"
#include "talking_mouth.h"

namespace semblance::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::UnorderedElementsAre;

constexpr int frames = 30;

class Animate : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }

  std::string write_track(LipTrack track = TalkingMouth{}.track(frames, 25.0)) const {
    write_lip_markers(path("lips.csv"), track);
    return path("lips.csv");
  }

  /// Stripes that move with the mouth's middle, as a folder of pictures.
  std::string write_video() const {
    fs::create_directory(path("video"));
    const TalkingMouth mouth;
    for (int f = 0; f < frames; ++f) {
      const Eigen::Vector2d middle = 0.5 * (mouth.marker(0, f / 25.0) + mouth.marker(4, f / 25.0));
      Image picture(320, 300, 3, 0.3f);
      for (int y = 0; y < 300; ++y) {
        for (int x = 0; x < 320; ++x) {
          picture.pixel(x, y)[0] = 0.5f + 0.3f * std::sin(0.2f * (x - float(middle.x())));
        }
      }
      write_image(path("video/" + std::to_string(1000 + f) + ".png"), picture);
    }
    return path("video");
  }

  ProgramResult animate(std::vector<std::string> more) const {
    std::vector<std::string> words{"sweep", "animate"};
    words.insert(words.end(), more.begin(), more.end());
    words.insert(words.end(), {"-o", path("out")});
    return run_program(words);
  }

  void expect_refused(const std::vector<std::string>& words, int code,
                      const std::string& message) const {
    const ProgramResult result = animate(words);
    EXPECT_EQ(result.exit_code, code) << result.output;
    EXPECT_THAT(result.output, HasSubstr(message));
    EXPECT_FALSE(fs::exists(path("out")));
  }

  std::vector<std::string> results() const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(path("out"))) {
      names.push_back(entry.path().filename().string());
    }
    return names;
  }

  TemporaryFolder folder_;
};

int frame_count(const std::string& path) {
  VideoSource video(path);
  Rgb8 picture;
  int count = 0;
  while (video.next(picture)) ++count;
  return count;
}

int occurrences(const std::string& text, const std::string& word) {
  int count = 0;
  for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) {
    ++count;
  }
  return count;
}

TEST_F(Animate, WritesPicturesMarkersWireframeAndGltf) {
  const std::string table = write_track(), video = write_video();
  const ProgramResult result =
      animate({table, "--video", video, "--keys", "2,9,14,27", "--json", path("summary.json")});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(results(),
              UnorderedElementsAre("animation.mp4", "wireframe.mp4", "animation.csv",
                                   "wireframe.json", "mouth.glb", "paths.svg", "wireframe.svg"));
  EXPECT_EQ(frame_count(path("out/animation.mp4")), 26);
  EXPECT_EQ(frame_count(path("out/wireframe.mp4")), 26);

  const LipTrack source = read_lip_markers(table),
                 animated = read_lip_markers(path("out/animation.csv"));
  ASSERT_EQ(animated.frames.size(), 26u);
  for (const int key : {2, 9, 14, 27}) {
    for (int i = 0; i < 16; ++i) {
      EXPECT_LT((animated.frames[key - 2].markers[i].position_px -
                 source.frames[key].markers[i].position_px)
                    .norm(),
                1e-6);
    }
  }
  const nlohmann::json wireframe = read_json_file(path("out/wireframe.json"));
  EXPECT_EQ(wireframe["frames"].size(), 26u);
  EXPECT_EQ(wireframe["frames"][0]["points_px"].size(), 160u);
  EXPECT_EQ(wireframe["triangles"].size(), 240u);
  EXPECT_EQ(wireframe["keys"].size(), 4u);
  // Markers of both key frames, O and M; all points of the wireframe.
  EXPECT_EQ(occurrences(file_bytes(path("out/paths.svg")), "<circle"), 2 * 16 + 2);
  EXPECT_EQ(occurrences(file_bytes(path("out/wireframe.svg")), "<circle"), 160);
  const nlohmann::json summary = read_json_file(path("summary.json"));
  EXPECT_EQ(summary["frames"], 26);
  EXPECT_EQ(summary["compared_frames"], 22);
  EXPECT_GT(summary["rms_px"].get<double>(), 0.0);
}

TEST_F(Animate, ShowsTheKeyFramesOwnPictures) {
  const std::string table = write_track(), video = write_video();
  ASSERT_EQ(animate({table, "--video", video, "--keys", "2,9,27"}).exit_code, 0);
  VideoSource source(video), animation(path("out/animation.mp4"));
  for (const int key : {2, 9, 27}) {
    Rgb8 expected, found;
    source.skip_to(key);
    animation.skip_to(key - 2);
    ASSERT_TRUE(source.next(expected) && animation.next(found));
    double sum = 0.0;
    for (std::size_t i = 0; i < expected.data.size(); ++i) {
      sum += std::abs(int(expected.data[i]) - int(found.data[i]));
    }
    EXPECT_LT(sum / double(expected.data.size()), 4.0) << key;  // of 255: the codec's loss
  }
}

TEST_F(Animate, ChoosesKeysAndNeedsNoVideo) {
  const ProgramResult result =
      animate({write_track(), "--budget", "5", "--tolerance", "0.1", "--fps", "50"});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output, HasSubstr("5 key frames, 59 frames at 50 per second"));
}

TEST_F(Animate, TakesEightMarkersAndOneStill) {
  const std::string table = write_track(TalkingMouth{}.track(frames, 25.0, 8));
  const ProgramResult result =
      animate({table, "--video", write_video(), "--keys", "0,10,20", "--still", "10", "--linear"});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_EQ(read_lip_markers(path("out/animation.csv")).marker_count, 16);
}

TEST_F(Animate, UsesScannedVisemes) {
  ASSERT_EQ(run_program({"sweep", "visemes", path("visemes.json")}).exit_code, 0);
  std::vector<Viseme> visemes = read_visemes(path("visemes.json"));
  EXPECT_EQ(visemes.size(), 5u);
  visemes.resize(1);
  visemes[0].name = "scanned";
  write_visemes(path("visemes.json"), visemes);
  const ProgramResult result = animate({write_track(), "--visemes", path("visemes.json"), "--keys",
                                        "3,20", "--json", path("summary.json")});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_EQ(read_json_file(path("summary.json"))["keys"][1]["viseme"], "scanned");
}

TEST_F(Animate, SameInputSameBytes) {
  const std::string table = write_track(), video = write_video();
  std::vector<std::string> first;
  for (const char* threads : {"1", "2"}) {
    ASSERT_EQ(animate({table, "--video", video, "--keys", "2,9", "--threads", threads}).exit_code,
              0);
    std::vector<std::string> bytes;
    for (const char* name : {"animation.mp4", "wireframe.mp4", "animation.csv", "wireframe.json",
                             "mouth.glb", "paths.svg", "wireframe.svg"}) {
      bytes.push_back(file_bytes(path(std::string("out/") + name)));
    }
    if (first.empty()) first = bytes;
    EXPECT_TRUE(first == bytes);
  }
}

TEST_F(Animate, RefusesBadInputAndLeavesNothing) {
  const std::string table = write_track();
  expect_refused({path("absent.csv")}, 3, "absent.csv");
  expect_refused({table, "--keys", "4,4"}, 3, "key frame 4 is given twice");
  expect_refused({table, "--keys", "4,400"}, 3, "frame 400 is not in the table");
  expect_refused({table, "--keys", "4"}, 3, "at least two");
  expect_refused({table, "--keys", "4,9", "-n", "-1"}, 3, "blending parameter n");
  expect_refused({table, "--keys", "4,9", "-m", "-2"}, 3, "blending parameter m");
  expect_refused({table, "--keys", "4,9", "-p", "nan"}, 3, "blending parameter p");
  expect_refused({table, "--radial", "1,1,.5,1"}, 3, "radial alpha");
  expect_refused({table, "--fibres", ".6,.5"}, 3, "fibre proportions");
  expect_refused({table, "--video", path("absent.mp4")}, 3, "absent.mp4");
  expect_refused({table, "--visemes", table}, 3, "not valid JSON");
  std::ofstream(path("empty.csv")).close();
  expect_refused({path("empty.csv")}, 3, "empty.csv: empty");

  LipTrack gaps = TalkingMouth{}.track(frames, 25.0);
  gaps.frames[7].markers[11].state = MarkerState::absent;
  expect_refused({write_track(gaps), "--keys", "7,20"}, 3, "marker 11 is absent");
  LipTrack far = TalkingMouth{{5000.0, 80.0}}.track(frames, 25.0);
  expect_refused({write_track(far), "--video", write_video()}, 3, "outside the 320 x 300 picture");
  expect_refused({write_track(TalkingMouth{}.track(2 * frames, 25.0)), "--video", path("video"),
                  "--keys", "3,50"},
                 3, "no frame 50");
}

TEST_F(Animate, RefusesWrongUsage) {
  const std::string table = write_track();
  expect_refused({table, "--keys", "4,9", "--budget", "3"}, 2, "--budget");
  expect_refused({table, "--budget", "1"}, 2, "--budget");
  expect_refused({table, "--fps", "0"}, 2, "--fps");
  expect_refused({table, "--still", "4"}, 2, "--still requires --video");
  expect_refused({table, "--radial", "1,2"}, 2, "--radial");
  EXPECT_EQ(run_program({"sweep", "animate", table}).exit_code, 2);
}

}  // namespace
}  // namespace semblance::testing
