// What files that cannot be used get: the documented exit code, a message that names the file and
// says how to mend it, and nothing half-written under the final names.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <set>

#include "program.h"
#include "semblance/io/image_io.h"
#include "semblance/io/track_file.h"
#include "semblance/io/video.h"
#include "small_clip.h"
#include "support.h"

namespace semblance::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsSubsetOf;

constexpr int kBadInput = 3, kNotConverged = 4;

class BadInput : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }
  ProgramResult track(const std::string& video, std::vector<std::string> more = {}) const {
    more.insert(more.begin(), {"track", "face", video, "-o", path("out")});
    return run_program(more);
  }
  /// Names in the output folder.
  std::set<std::string> results() const {
    std::set<std::string> names;
    if (!fs::exists(path("out"))) return names;
    for (const auto& entry : fs::directory_iterator(path("out"))) {
      names.insert(entry.path().filename().string());
    }
    return names;
  }
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(path(name), std::ios::binary) << text;
  }

 private:
  TemporaryFolder folder_;
};

/// Frames of a wall of squares, without anything like a face.
Rgb8 wall(int width, int height) {
  Rgb8 picture{width, height, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const auto grey = static_cast<std::uint8_t>(90 + 40 * ((x / 32 + y / 32) % 2));
      picture.data.insert(picture.data.end(), 3, grey);
    }
  }
  return picture;
}

void write_wall(const std::string& path, int frames) {
  VideoWriter writer(path, kSmallClipWidth, kSmallClipHeight, 25.0);
  for (int i = 0; i < frames; ++i) writer.write(wall(kSmallClipWidth, kSmallClipHeight));
  writer.close();
}

Rgb8 side_by_side(const Rgb8& picture) {
  Rgb8 pair{2 * picture.width, picture.height, {}};
  const std::size_t row = 3 * static_cast<std::size_t>(picture.width);
  for (std::size_t y = 0; y < static_cast<std::size_t>(picture.height); ++y) {
    const auto begin = picture.data.begin() + static_cast<std::ptrdiff_t>(y * row);
    for (int copy = 0; copy < 2; ++copy) {
      pair.data.insert(pair.data.end(), begin, begin + static_cast<std::ptrdiff_t>(row));
    }
  }
  return pair;
}

TEST_F(BadInput, MissingFile) {
  const ProgramResult result = track(path("absent.mp4"));
  EXPECT_EQ(result.exit_code, kBadInput);
  EXPECT_THAT(result.output, AllOf(HasSubstr("absent.mp4"), HasSubstr("no such file")));
  EXPECT_TRUE(results().empty());
}

TEST_F(BadInput, TextNamedAsVideo) {
  write("notes.mp4", "These are notes, not pictures.\n");
  const ProgramResult result = track(path("notes.mp4"));
  EXPECT_EQ(result.exit_code, kBadInput);
  EXPECT_THAT(result.output, AllOf(HasSubstr("notes.mp4"), HasSubstr("is not a video"),
                                   HasSubstr("was expected")));
  EXPECT_TRUE(results().empty());
}

TEST_F(BadInput, EmptyFileAndEmptyFolderHaveNoFrames) {
  write("empty.mp4", "");
  const ProgramResult file = track(path("empty.mp4"));
  EXPECT_EQ(file.exit_code, kBadInput);
  EXPECT_THAT(file.output, AllOf(HasSubstr("empty.mp4"), HasSubstr("empty")));
  fs::create_directory(path("frames"));
  const ProgramResult images = track(path("frames"));
  EXPECT_EQ(images.exit_code, kBadInput);
  EXPECT_THAT(images.output, AllOf(HasSubstr("frames"), HasSubstr("no images")));
  EXPECT_TRUE(results().empty());
}

TEST_F(BadInput, ContainerWithoutFrames) {
  write_wall(path("whole.avi"), 3);
  // Everything before the first picture: a well-formed header and an empty list of frames.
  const std::string whole = file_bytes(path("whole.avi"));
  const std::size_t frames = whole.find("movi");
  ASSERT_NE(frames, std::string::npos);
  write("header.avi", whole.substr(0, frames + 4));
  const ProgramResult result = track(path("header.avi"));
  EXPECT_EQ(result.exit_code, kBadInput);
  EXPECT_THAT(result.output, AllOf(HasSubstr("header.avi"), HasSubstr("no frame")));
  EXPECT_TRUE(results().empty());
}

TEST_F(BadInput, TruncatedVideo) {
  write_wall(path("whole.avi"), 40);
  const std::string whole = file_bytes(path("whole.avi"));
  write("cut.avi", whole.substr(0, whole.size() / 2));
  const ProgramResult result = track(path("cut.avi"));
  EXPECT_EQ(result.exit_code, kBadInput);
  EXPECT_THAT(result.output, AllOf(HasSubstr("cut.avi"), HasSubstr("cut off")));
  // The lines of the frames before the cut stay, for --resume; pictures and tables are not made.
  EXPECT_THAT(results(), IsSubsetOf({"track.jsonl", "checkpoint.bin"}));
  EXPECT_GT(read_track(path("out/track.jsonl")).frames.size(), 5u);
}

TEST_F(BadInput, VideoWithoutItsEndIsNoVideo) {
  write_wall(path("whole.mp4"), 40);
  const std::string whole = file_bytes(path("whole.mp4"));
  write("cut.mp4", whole.substr(0, whole.size() / 2));
  const ProgramResult result = track(path("cut.mp4"));
  EXPECT_EQ(result.exit_code, kBadInput);
  EXPECT_THAT(result.output, HasSubstr("cut.mp4"));
}

TEST_F(BadInput, NoFaceIsNotConverged) {
  write_wall(path("wall.mp4"), 5);
  const ProgramResult result = track(path("wall.mp4"));
  EXPECT_EQ(result.exit_code, kNotConverged);
  EXPECT_THAT(result.output,
              AllOf(HasSubstr("wall.mp4"), HasSubstr("no face was found"), HasSubstr("--points")));
  const Track written = read_track(path("out/track.jsonl"));
  ASSERT_EQ(written.frames.size(), 5u);
  for (const TrackFrame& frame : written.frames) EXPECT_EQ(frame.status, TrackStatus::lost);
}

TEST_F(BadInput, TwoFacesAskForAChoice) {
  VideoSource source(small_clip().video);
  fs::create_directory(path("pair"));
  Rgb8 picture;
  for (int i = 0; i < 2 && source.next(picture); ++i) {
    write_image(path("pair/" + std::to_string(i) + ".png"), side_by_side(picture));
  }
  const ProgramResult result = track(path("pair"));
  EXPECT_EQ(result.exit_code, kBadInput);
  EXPECT_THAT(result.output, AllOf(HasSubstr("2 faces"), HasSubstr("--face")));
  EXPECT_THAT(results(), IsSubsetOf({"track.jsonl", "checkpoint.bin"}));

  const ProgramResult chosen = track(path("pair"), {"--face", "1"});
  EXPECT_EQ(chosen.exit_code, 0) << chosen.output;
  const Track right = read_track(path("out/track.jsonl"));
  ASSERT_EQ(right.frames[0].status, TrackStatus::tracked);
  EXPECT_GT(right.frames[0].landmarks_px.at(30).x(), kSmallClipWidth);
}

TEST_F(BadInput, CameraOfAnotherSize) {
  write_wall(path("wall.mp4"), 2);
  write("camera.json", R"({"schema": "semblance.camera/1", "width": 640, "height": 480,
    "focal_px": [600, 600], "principal_px": [320, 240]})");
  const ProgramResult result = track(path("wall.mp4"), {"--camera", path("camera.json")});
  EXPECT_EQ(result.exit_code, kBadInput);
  EXPECT_THAT(result.output,
              AllOf(HasSubstr("camera.json"), HasSubstr("640 x 480"), HasSubstr("320 x 240")));
  EXPECT_TRUE(results().empty());
}

TEST_F(BadInput, CameraWithoutANumber) {
  write_wall(path("wall.mp4"), 2);
  for (const char* focal : {"NaN", "\"NaN\"", "null", "1e999"}) {
    write("camera.json", std::string(R"({"schema": "semblance.camera/1", "width": 320,
      "height": 240, "principal_px": [160, 120], "focal_px": [)") +
                             focal + ", 300]}");
    const ProgramResult result = track(path("wall.mp4"), {"--camera", path("camera.json")});
    EXPECT_EQ(result.exit_code, kBadInput) << focal;
    EXPECT_THAT(result.output, HasSubstr("camera.json")) << focal;
  }
  EXPECT_TRUE(results().empty());
}

TEST_F(BadInput, PointsOutsideThePicture) {
  write_wall(path("wall.mp4"), 2);
  std::string points;
  for (int i = 0; i < 68; ++i) points += std::string(i > 0 ? "," : "") + "[9000, 20]";
  write("marks.json", "{\"points\": [" + points + "]}");
  const ProgramResult result = track(path("wall.mp4"), {"--points", path("marks.json")});
  EXPECT_EQ(result.exit_code, kBadInput);
  EXPECT_THAT(result.output, AllOf(HasSubstr("marks.json"), HasSubstr("outside the picture")));
  EXPECT_TRUE(results().empty());
}

TEST_F(BadInput, OutputFolderThatCannotBeMade) {
  write_wall(path("wall.mp4"), 2);
  // Below a regular file: refused to every user, the superuser too.
  for (const std::string& folder : {path("wall.mp4"), path("wall.mp4/out")}) {
    const ProgramResult result = run_program({"track", "face", path("wall.mp4"), "-o", folder});
    EXPECT_EQ(result.exit_code, kBadInput) << folder;
    EXPECT_THAT(result.output, AllOf(HasSubstr(folder), HasSubstr("output folder"))) << folder;
  }
  const ProgramResult demo = run_program({"demo", "-o", path("wall.mp4/demo")});
  EXPECT_EQ(demo.exit_code, kBadInput);
  EXPECT_THAT(demo.output, AllOf(HasSubstr("wall.mp4/demo"), HasSubstr("output folder")));
}

TEST_F(BadInput, ScoreWithoutTruth) {
  const ProgramResult absent = run_program({"score", path("absent"), path("absent")});
  EXPECT_EQ(absent.exit_code, kBadInput);
  EXPECT_THAT(absent.output, AllOf(HasSubstr("absent"), HasSubstr("semblance synth")));
  fs::create_directory(path("nothing"));
  const ProgramResult nothing = run_program({"score", path("nothing"), path("nothing")});
  EXPECT_EQ(nothing.exit_code, kBadInput);
  EXPECT_THAT(nothing.output, AllOf(HasSubstr("nothing"), HasSubstr("truth.jsonl")));
}

TEST_F(BadInput, SuiteWithUnknownKey) {
  write("suite.json",
        R"({"schema": "semblance.suite/1", "name": "mine", "about": "x", "same_model": true,
            "clips": [{"name": "a", "speed": 3}]})");
  const ProgramResult result = run_program({"synth", path("suite.json"), "-o", path("clips")});
  EXPECT_EQ(result.exit_code, kBadInput);
  EXPECT_THAT(result.output, AllOf(HasSubstr("suite.json"), HasSubstr("speed")));
  EXPECT_FALSE(fs::exists(path("clips")));
}

TEST_F(BadInput, LipsOfAFileThatIsNoVideo) {
  write("notes.mp4", "These are notes, not pictures.\n");
  for (const char* markers : {"16", "none"}) {
    for (const char* name : {"notes.mp4", "absent.mp4"}) {
      const ProgramResult result =
          run_program({"track", "lips", path(name), "-o", path("out"), "--markers", markers});
      EXPECT_EQ(result.exit_code, kBadInput);
      EXPECT_THAT(result.output, HasSubstr(name));
      EXPECT_FALSE(fs::exists(path("out")));
    }
  }
}

TEST_F(BadInput, LipsWithoutDots) {
  write_wall(path("wall.mp4"), 4);
  const ProgramResult result =
      run_program({"track", "lips", path("wall.mp4"), "-o", path("out"), "--markers", "16"});
  EXPECT_EQ(result.exit_code, kNotConverged);
  EXPECT_THAT(result.output, AllOf(HasSubstr("wall.mp4"), HasSubstr("no markers found"),
                                   HasSubstr("--markers none")));
  EXPECT_FALSE(fs::exists(path("out")));
  // What another run left in a folder is not this one's to remove.
  fs::create_directory(path("out"));
  write("out/notes.txt", "mine");
  EXPECT_EQ(run_program({"track", "lips", path("wall.mp4"), "-o", path("out")}).exit_code,
            kNotConverged);
  EXPECT_THAT(results(), ::testing::ElementsAre("notes.txt"));
}

}  // namespace
}  // namespace semblance::testing
