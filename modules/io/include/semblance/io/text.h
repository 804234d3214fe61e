// Bounded reading of text files, shared by all readers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace semblance::text {

/// The whole file. Throws IoError if it cannot be read, InvalidInput if it is a folder or larger
/// than `limit_bytes`.
std::string read_file(const std::string& path,
                      std::uintmax_t limit_bytes = std::uintmax_t{2} << 30);

/// Lines of a text one by one, without their end (LF, CR LF or CR).
class Lines {
 public:
  explicit Lines(std::string_view text) : rest_(text) {}
  bool next(std::string_view& line);
  /// Number of the line given last, from 1.
  int number() const { return number_; }

 private:
  std::string_view rest_;
  int number_ = 0;
};

/// Cuts the next word (up to blanks) off `line`; empty at the end.
std::string_view next_word(std::string_view& line);

/// Parses the whole of `word`. False where it is not a number, out of range or not finite.
bool parse(std::string_view word, double& value);
bool parse(std::string_view word, float& value);
bool parse(std::string_view word, int& value);
bool parse(std::string_view word, std::uint64_t& value);

/// ".png" for "A.PNG".
std::string lower_extension(const std::string& path);

/// `text` for a message: shortened, unprintable bytes replaced.
std::string quoted(std::string_view text);

}  // namespace semblance::text
