#include "support.h"

#include <unistd.h>

#include <atomic>
#include <cstdlib>

namespace semblance::testing {

std::filesystem::path data_path(const std::string& relative) {
  const char* folder = std::getenv("SEMBLANCE_DATA");
  return std::filesystem::path(folder != nullptr ? folder : SEMBLANCE_DATA) / relative;
}

TemporaryFolder::TemporaryFolder() {
  static std::atomic<int> counter{0};
  path_ = std::filesystem::temp_directory_path() /
          ("semblance-test-" + std::to_string(getpid()) + "-" + std::to_string(counter++));
  std::filesystem::create_directories(path_);
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

}  // namespace semblance::testing
