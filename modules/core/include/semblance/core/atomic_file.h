// Output files that appear whole under their final name, or not at all.
#pragma once

#include <filesystem>
#include <fstream>

namespace semblance {

/// Writes a file under a temporary name in the same folder and renames it on `commit`. Destroyed
/// without a commit, it removes the temporary file and leaves whatever had the final name.
///
///     AtomicFile file("out/track.csv");
///     file.stream() << "frame,time_s\n";
///     file.commit();
///
/// A writer that wants a name of its own (a video encoder) is given `temporary_path()`, which keeps
/// the extension, and must have closed the file before `commit`.
///
/// Every failure throws IoError with the final path and the system's reason.
class AtomicFile {
 public:
  /// Creates the temporary file, so an unwritable folder is reported before the work is done. Also
  /// refuses a path that exists and is not a regular file.
  explicit AtomicFile(std::filesystem::path path);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  /// Binary stream onto the temporary file. Its state is checked by `commit`.
  std::ostream& stream();
  const std::filesystem::path& path() const { return path_; }
  const std::filesystem::path& temporary_path() const { return temporary_path_; }
  /// Closes the stream and gives the file its final name, replacing what had it.
  void commit();

 private:
  std::filesystem::path path_;
  std::filesystem::path temporary_path_;
  std::ofstream stream_;
  bool committed_ = false;
};

/// Makes the folder where it is not there yet; the one above it must be. True if it was made here.
/// Throws IoError with the remedy.
bool prepare_output_folder(const std::filesystem::path& folder);

}  // namespace semblance
