#include "semblance/core/child_process.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <cstring>
#include <sstream>
#include <system_error>
#include <thread>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

namespace fs = std::filesystem;

// The environment, with one variable set.
std::vector<std::string> environment_without_display() {
  constexpr std::string_view variable = "QT_QPA_PLATFORM=";
  std::vector<std::string> result;
  for (char** entry = environ; *entry != nullptr; ++entry) {
    if (std::string_view(*entry).substr(0, variable.size()) != variable)
      result.emplace_back(*entry);
  }
  result.push_back(std::string(variable) + "offscreen");
  return result;
}

std::vector<char*> pointers(std::vector<std::string>& texts) {
  std::vector<char*> result;
  for (std::string& text : texts) result.push_back(text.data());
  result.push_back(nullptr);
  return result;
}

class FileActions {
 public:
  explicit FileActions(const fs::path& log) {
    posix_spawn_file_actions_init(&actions_);
    posix_spawn_file_actions_addopen(&actions_, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&actions_, STDOUT_FILENO, log.c_str(),
                                     O_WRONLY | O_CREAT | O_APPEND, 0644);
    posix_spawn_file_actions_adddup2(&actions_, STDOUT_FILENO, STDERR_FILENO);
  }
  ~FileActions() { posix_spawn_file_actions_destroy(&actions_); }
  FileActions(const FileActions&) = delete;
  FileActions& operator=(const FileActions&) = delete;
  const posix_spawn_file_actions_t* get() const { return &actions_; }

 private:
  posix_spawn_file_actions_t actions_;
};

int wait_for(pid_t child, const std::function<bool()>& cancelled) {
  constexpr std::chrono::milliseconds pause(20);
  int status = 0;
  bool ended = false;
  while (waitpid(child, &status, cancelled ? WNOHANG : 0) != child) {
    if (!ended && cancelled && cancelled()) {
      kill(child, SIGTERM);
      ended = true;
    }
    std::this_thread::sleep_for(pause);
  }
  return WIFEXITED(status) && !ended ? WEXITSTATUS(status) : -1;
}

}  // namespace

std::optional<fs::path> find_program(const std::string& name) {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path == nullptr ? "" : path);
  for (std::string folder; std::getline(folders, folder, ':');) {
    const fs::path candidate = fs::path(folder) / name;
    if (!folder.empty() && access(candidate.c_str(), X_OK) == 0 && fs::is_regular_file(candidate)) {
      return candidate;
    }
  }
  return std::nullopt;
}

int run_program(const fs::path& program, const std::vector<std::string>& arguments,
                const fs::path& log, const std::function<bool()>& cancelled) {
  std::vector<std::string> words{program.string()};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<std::string> environment = environment_without_display();
  const FileActions actions(log);
  pid_t child = 0;
  const int error = posix_spawn(&child, program.c_str(), actions.get(), nullptr,
                                pointers(words).data(), pointers(environment).data());
  if (error != 0) {
    throw IoError(program.string() + ": cannot be started (" +
                  std::generic_category().message(error) + ")");
  }
  return wait_for(child, cancelled);
}

}  // namespace semblance
