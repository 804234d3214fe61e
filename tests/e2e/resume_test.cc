// A run that was killed or interrupted and then resumed leaves the same bytes as one that was not.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>

#include "program.h"
#include "semblance/io/track_file.h"
#include "semblance/io/video.h"
#include "small_clip.h"
#include "support.h"

namespace semblance::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

constexpr int kCheckpointEvery = 6;

std::vector<std::string> tracking(const fs::path& folder) {
  const ClipFiles clip = small_clip();
  return {"track",
          "face",
          clip.video,
          "--camera",
          clip.camera,
          "-o",
          folder.string(),
          "--checkpoint-every",
          std::to_string(kCheckpointEvery)};
}

std::vector<std::string> resumed(const fs::path& folder) {
  std::vector<std::string> arguments = tracking(folder);
  arguments.push_back("--resume");
  return arguments;
}

/// Results that have no times of the clock in them.
void expect_same_results(const fs::path& a, const fs::path& b) {
  for (const char* name : {"track.jsonl", "track.csv", "overlay.mp4", "face.glb"}) {
    const std::string bytes = file_bytes(a / name);
    EXPECT_FALSE(bytes.empty()) << name;
    EXPECT_TRUE(bytes == file_bytes(b / name)) << name << " differs";
  }
}

TEST(Resume, AfterKillGivesTheSameBytes) {
  const TemporaryFolder folder;
  const fs::path whole = folder.path() / "whole", killed = folder.path() / "killed";
  const ProgramResult reference = run_program(tracking(whole));
  ASSERT_EQ(reference.exit_code, 0) << reference.output;
  {
    RunningProgram program(tracking(killed));
    // The header, one checkpoint's worth of frames, and some that the checkpoint does not have.
    ASSERT_TRUE(program.wait_for_lines(killed / "track.jsonl", 1 + kCheckpointEvery + 3));
    program.signal(SIGKILL);
    ASSERT_EQ(program.wait().exit_code, 128 + SIGKILL);
  }
  ASSERT_TRUE(fs::exists(killed / "checkpoint.bin"));
  const int done = static_cast<int>(read_track((killed / "track.jsonl").string()).frames.size());
  ASSERT_LT(done, kSmallClipFrames) << "killed too late to test anything";
  const ProgramResult rest = run_program(resumed(killed));
  ASSERT_EQ(rest.exit_code, 0) << rest.output;
  expect_same_results(whole, killed);
}

TEST(Resume, OfAFinishedRunGivesTheSameBytes) {
  const TemporaryFolder folder;
  const fs::path once = folder.path() / "once", again = folder.path() / "again";
  ASSERT_EQ(run_program(tracking(once)).exit_code, 0);
  EXPECT_FALSE(fs::exists(once / "checkpoint.bin"));
  fs::copy(once, again);
  const ProgramResult result = run_program(resumed(again));
  ASSERT_EQ(result.exit_code, 0) << result.output;
  expect_same_results(once, again);
  std::vector<std::string> other = resumed(again);
  other.insert(other.end(), {"--optimizer", "ceres"});
  EXPECT_EQ(run_program(other).exit_code, 3);
  expect_same_results(once, again);
}

TEST(Resume, GoesOnAfterTheLastFrameThatWasAskedFor) {
  const TemporaryFolder folder;
  const fs::path whole = folder.path() / "whole", parts = folder.path() / "parts";
  ASSERT_EQ(run_program(tracking(whole)).exit_code, 0);
  std::vector<std::string> arguments = tracking(parts);
  arguments.insert(arguments.end(), {"--last-frame", "2"});
  ASSERT_EQ(run_program(arguments).exit_code, 0);
  EXPECT_TRUE(fs::exists(parts / "checkpoint.bin"));
  ASSERT_EQ(run_program(resumed(parts)).exit_code, 0);
  expect_same_results(whole, parts);
}

TEST(Resume, AfterInterruptGivesTheSameBytes) {
  const TemporaryFolder folder;
  const fs::path whole = folder.path() / "whole", stopped = folder.path() / "stopped";
  ASSERT_EQ(run_program(tracking(whole)).exit_code, 0);
  {
    RunningProgram program(tracking(stopped));
    ASSERT_TRUE(program.wait_for_lines(stopped / "track.jsonl", 1 + 4));
    program.signal(SIGINT);
    const ProgramResult result = program.wait();
    EXPECT_EQ(result.exit_code, 0) << result.output;
    EXPECT_THAT(result.output, HasSubstr("--resume"));
  }
  // All that was done is there, in whole files.
  const Track part = read_track((stopped / "track.jsonl").string());
  ASSERT_GE(part.frames.size(), 4u);
  ASSERT_LT(part.frames.size(), static_cast<std::size_t>(kSmallClipFrames));
  VideoSource overlay((stopped / "overlay.mp4").string());
  Rgb8 picture;
  std::size_t pictures = 0;
  while (overlay.next(picture)) ++pictures;
  EXPECT_EQ(pictures, part.frames.size());

  const ProgramResult rest = run_program(resumed(stopped));
  ASSERT_EQ(rest.exit_code, 0) << rest.output;
  expect_same_results(whole, stopped);
}

TEST(Resume, RefusesAnotherConfiguration) {
  const TemporaryFolder folder;
  std::vector<std::string> arguments = tracking(folder.path() / "out");
  arguments.insert(arguments.end(), {"--last-frame", "2"});
  ASSERT_EQ(run_program(arguments).exit_code, 0);
  std::vector<std::string> other = resumed(folder.path() / "out");
  other.insert(other.end(), {"--optimizer", "ceres"});
  const ProgramResult result = run_program(other);
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(result.output, HasSubstr("other settings"));
}

TEST(Resume, WithoutAnEarlierRunStartsAfresh) {
  const TemporaryFolder folder;
  std::vector<std::string> arguments = resumed(folder.path() / "out");
  arguments.insert(arguments.end(), {"--last-frame", "1", "--no-overlay"});
  const ProgramResult result = run_program(arguments);
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_EQ(read_track((folder.path() / "out/track.jsonl").string()).frames.size(), 2u);
}

}  // namespace
}  // namespace semblance::testing
