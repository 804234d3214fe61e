#include "semblance/core/atomic_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <system_error>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

std::filesystem::path temporary_name(const std::filesystem::path& path) {
  // Two writers of the same file, in one process or in two, must not share a temporary name.
  static std::atomic<unsigned> counter{0};
  const std::string name = fmt::format(".{}.partial-{}-{}{}", path.stem().string(), getpid(),
                                       counter++, path.extension().string());
  return path.parent_path() / name;
}

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& reason) {
  throw IoError(fmt::format("{}: cannot write: {}", path.string(), reason));
}

std::string system_reason(int error) { return std::generic_category().message(error); }

}  // namespace

AtomicFile::AtomicFile(std::filesystem::path path)
    : path_(std::move(path)), temporary_path_(temporary_name(path_)) {
  std::error_code ignored;
  const auto status = std::filesystem::status(path_, ignored);
  if (!path_.has_filename()) fail(path_, "a file name is needed");
  // Renaming over a device or a pipe would replace it for every other program.
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status)) {
    fail(path_, "it exists and is not a regular file");
  }
  const int file = open(temporary_path_.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0666);
  if (file < 0) fail(path_, system_reason(errno));
  close(file);
}

AtomicFile::~AtomicFile() {
  if (committed_) return;
  stream_.close();
  std::error_code ignored;
  std::filesystem::remove(temporary_path_, ignored);
}

std::ostream& AtomicFile::stream() {
  if (!stream_.is_open()) {
    errno = 0;
    stream_.open(temporary_path_, std::ios::binary | std::ios::trunc);
    if (!stream_) fail(path_, system_reason(errno));
  }
  return stream_;
}

void AtomicFile::commit() {
  if (stream_.is_open()) {
    errno = 0;
    stream_.close();
    if (!stream_) fail(path_, errno != 0 ? system_reason(errno) : "writing failed");
  }
  if (std::rename(temporary_path_.c_str(), path_.c_str()) != 0) fail(path_, system_reason(errno));
  committed_ = true;
}

bool prepare_output_folder(const std::filesystem::path& folder) {
  std::error_code error;
  const bool there = std::filesystem::is_directory(folder);
  if (!there) std::filesystem::create_directory(folder, error);
  if (error || !std::filesystem::is_directory(folder)) {
    throw IoError(folder.string() + ": cannot be used as the output folder" +
                  (error ? " (" + error.message() + ")" : std::string()) +
                  "; name a folder in a place you can write to");
  }
  return !there;
}

}  // namespace semblance
