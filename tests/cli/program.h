// Runs the built `semblance` program as a user would.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace semblance::testing {

struct ProgramResult {
  int exit_code = -1;  // 128 + signal where one ended it, as in a shell
  std::string output;  // stdout and stderr together
};

/// A program under way. Ended by force with the object.
class RunningProgram {
 public:
  explicit RunningProgram(const std::vector<std::string>& arguments);
  ~RunningProgram();
  RunningProgram(const RunningProgram&) = delete;
  RunningProgram& operator=(const RunningProgram&) = delete;

  /// Waits until `file` has at least `lines` lines; false if the program ended before.
  bool wait_for_lines(const std::filesystem::path& file, int lines);
  void signal(int number) const;
  ProgramResult wait();

 private:
  bool ended();

  std::filesystem::path output_path_;
  pid_t pid_ = -1;
  int status_ = 0;
  bool reaped_ = false;
};

ProgramResult run_program(const std::vector<std::string>& arguments);

/// The bytes of a file, empty where there is none.
std::string file_bytes(const std::filesystem::path& path);

}  // namespace semblance::testing
