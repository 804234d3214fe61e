#include "program.h"

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <thread>

namespace semblance::testing {

namespace fs = std::filesystem;

namespace {

fs::path fresh_output_path() {
  static std::atomic<int> counter{0};
  return fs::temp_directory_path() /
         ("semblance-output-" + std::to_string(getpid()) + "-" + std::to_string(counter++));
}

[[noreturn]] void become_program(const fs::path& output, std::vector<char*>& arguments) {
  const int sink = open(output.c_str(), O_CREAT | O_TRUNC | O_WRONLY, 0600);
  if (sink < 0 || dup2(sink, STDOUT_FILENO) < 0 || dup2(sink, STDERR_FILENO) < 0) _exit(126);
  execv(arguments[0], arguments.data());
  _exit(127);
}

}  // namespace

RunningProgram::RunningProgram(const std::vector<std::string>& arguments)
    : output_path_(fresh_output_path()) {
  std::vector<std::string> words{SEMBLANCE_PROGRAM};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  pid_ = fork();
  if (pid_ < 0) throw std::runtime_error("cannot start a process");
  if (pid_ == 0) become_program(output_path_, pointers);
}

RunningProgram::~RunningProgram() {
  if (!ended()) {
    signal(SIGKILL);
    waitpid(pid_, &status_, 0);
  }
  std::error_code ignored;
  fs::remove(output_path_, ignored);
}

bool RunningProgram::ended() {
  if (!reaped_) reaped_ = waitpid(pid_, &status_, WNOHANG) == pid_;
  return reaped_;
}

bool RunningProgram::wait_for_lines(const fs::path& file, int lines) {
  const auto enough = [&] {
    const std::string bytes = file_bytes(file);
    return std::count(bytes.begin(), bytes.end(), '\n') >= lines;
  };
  while (!ended()) {
    if (enough()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return false;
}

void RunningProgram::signal(int number) const { kill(pid_, number); }

ProgramResult RunningProgram::wait() {
  if (!reaped_) {
    waitpid(pid_, &status_, 0);
    reaped_ = true;
  }
  ProgramResult result;
  result.exit_code = WIFEXITED(status_) ? WEXITSTATUS(status_) : 128 + WTERMSIG(status_);
  result.output = file_bytes(output_path_);
  return result;
}

ProgramResult run_program(const std::vector<std::string>& arguments) {
  return RunningProgram(arguments).wait();
}

std::string file_bytes(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace semblance::testing
