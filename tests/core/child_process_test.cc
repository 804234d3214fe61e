#include "semblance/core/child_process.h"

#include <gmock/gmock.h>

#include <chrono>
#include <fstream>
#include <iterator>

#include "semblance/core/errors.h"
#include "support.h"

namespace semblance {
namespace {

namespace fs = std::filesystem;

class ChildProcess : public ::testing::Test {
 protected:
  fs::path log() const { return folder_.path() / "log.txt"; }
  std::string printed() const {
    std::ifstream stream(log());
    return {std::istreambuf_iterator<char>(stream), {}};
  }

 private:
  testing::TemporaryFolder folder_;
};

TEST_F(ChildProcess, GetsItsArgumentsUnchanged) {
  const auto program = find_program("printf");
  ASSERT_TRUE(program);
  const std::string nasty = "a b; $(touch x) 'q' \"d\" `e` \\ *";
  EXPECT_EQ(run_program(*program, {"%s|", nasty, ""}, log()), 0);
  EXPECT_EQ(printed(), nasty + "||");
  EXPECT_EQ(run_program(*program, {"more"}, log()), 0);
  EXPECT_EQ(printed(), nasty + "||more");
}

TEST_F(ChildProcess, StatusAndBothStreamsArrive) {
  const int status =
      run_program(*find_program("sh"), {"-c", "echo $QT_QPA_PLATFORM >&2; exit 7"}, log());
  EXPECT_EQ(status, 7);
  EXPECT_EQ(printed(), "offscreen\n");
  EXPECT_EQ(run_program(*find_program("sh"), {"-c", "kill -9 $$"}, log()), -1);
}

TEST_F(ChildProcess, IsEndedWhenCancelled) {
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EQ(run_program(*find_program("sleep"), {"60"}, log(), [] { return true; }), -1);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(30));
}

TEST_F(ChildProcess, MissingProgramsAreSaid) {
  EXPECT_FALSE(find_program("semblance-has-no-such-program"));
  EXPECT_THROW(run_program("/nowhere/program", {}, log()), IoError);
}

}  // namespace
}  // namespace semblance
