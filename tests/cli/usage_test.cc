// What a wrong command line gets: exit code 2, a message that names the culprit, and no files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "program.h"
#include "support.h"

namespace semblance::testing {
namespace {

using ::testing::HasSubstr;

TEST(Usage, HelpAndVersionSucceed) {
  const ProgramResult help = run_program({"track", "face", "--help"});
  EXPECT_EQ(help.exit_code, 0);
  EXPECT_THAT(help.output, HasSubstr("--resume"));
  const ProgramResult version = run_program({"--version"});
  EXPECT_EQ(version.exit_code, 0);
  EXPECT_THAT(version.output, HasSubstr("semblance "));
}

TEST(Usage, ACommandIsNeeded) {
  const ProgramResult result = run_program({});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.output, HasSubstr("subcommand is required"));
}

TEST(Usage, UnknownOptionIsNamed) {
  const TemporaryFolder folder;
  const std::string out = (folder.path() / "out").string();
  const ProgramResult result = run_program({"track", "face", "clip.mp4", "-o", out, "--bogus"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.output, HasSubstr("--bogus"));
  EXPECT_FALSE(std::filesystem::exists(out));
}

TEST(Usage, OutputFolderIsRequired) {
  const ProgramResult result = run_program({"track", "face", "clip.mp4"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.output, HasSubstr("--output is required"));
}

TEST(Usage, UnknownOptimizerListsTheKnownOnes) {
  const ProgramResult result =
      run_program({"track", "face", "clip.mp4", "-o", "out", "--optimizer", "magic"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.output, HasSubstr("magic"));
  EXPECT_THAT(result.output, HasSubstr("cmaes"));
}

TEST(Usage, LipsHaveEightOrSixteenMarkersOrNone) {
  const TemporaryFolder folder;
  const std::string out = (folder.path() / "out").string();
  for (const char* count : {"12", "0", "-8", "sixteen"}) {
    const ProgramResult result =
        run_program({"track", "lips", "clip.mp4", "-o", out, "--markers", count});
    EXPECT_EQ(result.exit_code, 2) << count;
    EXPECT_THAT(result.output, HasSubstr("none")) << count;
  }
  EXPECT_EQ(run_program({"track", "lips", "-o", out}).exit_code, 2);
  EXPECT_EQ(run_program({"track", "lips", "clip.mp4"}).exit_code, 2);
  EXPECT_EQ(
      run_program({"track", "lips", "clip.mp4", "-o", out, "--velocity-frames", "0"}).exit_code, 2);
  EXPECT_FALSE(std::filesystem::exists(out));
}

TEST(Usage, ValuesOutOfRangeAreRefused) {
  EXPECT_EQ(run_program({"track", "face", "clip.mp4", "-o", "out", "--focal", "-5"}).exit_code, 2);
  EXPECT_EQ(run_program({"track", "face", "clip.mp4", "-o", "out", "--face", "-1"}).exit_code, 2);
}

TEST(Usage, UnknownConfigurationKeyIsNamed) {
  const TemporaryFolder folder;
  const std::string path = (folder.path() / "run.toml").string();
  std::ofstream(path) << "[track.face]\nsmoothness = 3\n";
  const ProgramResult result =
      run_program({"--config", path, "track", "face", "clip.mp4", "-o", "out"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.output, HasSubstr("smoothness"));
}

}  // namespace
}  // namespace semblance::testing
