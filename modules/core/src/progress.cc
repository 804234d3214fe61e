#include "semblance/core/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdio>

namespace semblance {
namespace {

using Clock = std::chrono::steady_clock;

class SilentProgress final : public Progress {
 public:
  void begin(const std::string&, std::int64_t) override {}
  void update(std::int64_t) override {}
  void end() override {}
};

std::string duration_text(double seconds) {
  const auto whole = static_cast<std::int64_t>(seconds + 0.5);
  if (whole < 60) return fmt::format("{} s", whole);
  if (whole < 3600) return fmt::format("{} min {:02} s", whole / 60, whole % 60);
  return fmt::format("{} h {:02} min", whole / 3600, whole % 3600 / 60);
}

class ConsoleProgress final : public Progress {
 public:
  void begin(const std::string& task, std::int64_t total) override {
    task_ = task;
    total_ = total;
    done_ = 0;
    start_ = last_ = Clock::now();
    if (!terminal_) fmt::print(stderr, "{} ...\n", task_);
  }

  void update(std::int64_t done) override {
    done_ = done;
    const auto now = Clock::now();
    const auto pause = terminal_ ? std::chrono::milliseconds(100) : std::chrono::seconds(5);
    if (now - last_ < pause) return;
    last_ = now;
    write(status(), false);
  }

  void end() override {
    const double seconds = elapsed_s();
    std::string text = fmt::format("{}: {} in {}", task_, count_text(), duration_text(seconds));
    if (seconds > 0.0 && done_ > 0) text += fmt::format(" ({:.1f}/s)", done_ / seconds);
    write(text, true);
  }

  bool cancelled() const override { return interrupted(); }

 private:
  double elapsed_s() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }

  std::string count_text() const {
    return total_ > 0 ? fmt::format("{}/{}", done_, total_) : fmt::format("{}", done_);
  }

  std::string status() const {
    const double rate = done_ / elapsed_s();
    std::string text = fmt::format("{}: {}", task_, count_text());
    if (total_ > 0) text += fmt::format(" ({:.0f} %)", 100.0 * done_ / total_);
    text += fmt::format(", {:.1f}/s", rate);
    if (total_ > done_ && done_ > 0) {
      text += fmt::format(", {} left", duration_text((total_ - done_) / rate));
    }
    return text;
  }

  void write(const std::string& text, bool final) const {
    if (terminal_) {
      fmt::print(stderr, "\r\033[K{}{}", text, final ? "\n" : "");
    } else {
      fmt::print(stderr, "{}\n", text);
    }
    std::fflush(stderr);
  }

  bool terminal_ = isatty(STDERR_FILENO) != 0;
  std::string task_;
  std::int64_t total_ = 0;
  std::int64_t done_ = 0;
  Clock::time_point start_, last_;
};

volatile std::sig_atomic_t interrupt_flag = 0;

void on_interrupt(int signal_number) {
  if (interrupt_flag != 0) {
    std::signal(signal_number, SIG_DFL);
    std::raise(signal_number);
  }
  interrupt_flag = 1;
}

}  // namespace

Progress& silent_progress() {
  static SilentProgress progress;
  return progress;
}

std::unique_ptr<Progress> console_progress() { return std::make_unique<ConsoleProgress>(); }

void catch_interrupts() {
  struct sigaction action {};
  action.sa_handler = on_interrupt;
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

bool interrupted() { return interrupt_flag != 0; }

}  // namespace semblance
