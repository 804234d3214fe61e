// Helpers shared by tests.
#pragma once

#include <filesystem>
#include <string>

namespace semblance::testing {

/// Path below the folder of real data (environment SEMBLANCE_DATA, else the configured default).
std::filesystem::path data_path(const std::string& relative);

/// A fresh folder, removed with the object.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace semblance::testing

/// Ends the test as skipped, saying what is missing, unless the real data has the file.
#define SEMBLANCE_NEED_DATA(relative)                                      \
  if (!std::filesystem::exists(::semblance::testing::data_path(relative))) \
  GTEST_SKIP() << "needs " << ::semblance::testing::data_path(relative) << " (set SEMBLANCE_DATA)"
