#include "semblance/core/progress.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <string>

#include "semblance/core/version.h"

namespace semblance {
namespace {

using ::testing::HasSubstr;

TEST(Progress, ConsoleWritesPlainLinesWhenStderrIsNoTerminal) {
  ::testing::internal::CaptureStderr();
  auto progress = console_progress();
  progress->begin("tracking", 20);
  for (int i = 1; i <= 20; ++i) progress->update(i);
  progress->end();
  const std::string text = ::testing::internal::GetCapturedStderr();
  EXPECT_THAT(text, HasSubstr("tracking ...\n"));
  EXPECT_THAT(text, HasSubstr("tracking: 20/20 in 0 s"));
  EXPECT_EQ(text.find('\r'), std::string::npos);
  EXPECT_EQ(text.back(), '\n');
}

TEST(Progress, SilentSaysNothingAndNeverCancels) {
  ::testing::internal::CaptureStderr();
  silent_progress().begin("quiet", 3);
  silent_progress().update(3);
  silent_progress().end();
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
  EXPECT_FALSE(silent_progress().cancelled());
}

// Signals are the state of the whole process, so these run in one of their own.
void interrupt_once_and_report() {
  catch_interrupts();
  const auto progress = console_progress();
  if (interrupted() || progress->cancelled()) std::_Exit(10);
  std::raise(SIGTERM);
  std::_Exit(interrupted() && progress->cancelled() ? 0 : 11);
}

void interrupt_twice() {
  catch_interrupts();
  std::raise(SIGTERM);
  std::raise(SIGINT);
  std::_Exit(12);
}

TEST(InterruptsDeathTest, TheFirstSetsTheFlag) {
  EXPECT_EXIT(interrupt_once_and_report(), ::testing::ExitedWithCode(0), "");
}

TEST(InterruptsDeathTest, TheSecondEndsTheProgram) {
  EXPECT_EXIT(interrupt_twice(), ::testing::KilledBySignal(SIGINT), "");
}

TEST(Version, NamesTheProgramAndThreeFigures) {
  EXPECT_THAT(program_version(), ::testing::MatchesRegex("semblance [0-9]+\\.[0-9]+\\.[0-9]+"));
}

}  // namespace
}  // namespace semblance
