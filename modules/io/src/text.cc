#include "semblance/io/text.h"

#include <cctype>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <system_error>

#include "semblance/core/errors.h"

namespace semblance::text {

std::string read_file(const std::string& path, std::uintmax_t limit_bytes) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) {
    throw InvalidInput(path + ": is a folder; a file was expected");
  }
  errno = 0;
  std::ifstream stream(path, std::ios::binary);
  if (!stream) {
    throw IoError(path + ": cannot be opened: " + std::strerror(errno != 0 ? errno : ENOENT));
  }
  std::string content;
  std::vector<char> block(std::size_t{1} << 16);
  while (stream.read(block.data(), static_cast<std::streamsize>(block.size())),
         stream.gcount() > 0) {
    content.append(block.data(), static_cast<std::size_t>(stream.gcount()));
    if (content.size() > limit_bytes) {
      throw InvalidInput(path + ": is larger than " + std::to_string(limit_bytes >> 20) +
                         " MiB, the most that is read of such a file");
    }
  }
  if (stream.bad()) throw IoError(path + ": reading failed");
  return content;
}

bool Lines::next(std::string_view& line) {
  if (rest_.empty()) return false;
  const std::size_t end = rest_.find_first_of("\r\n");
  line = rest_.substr(0, end);
  if (end == std::string_view::npos) {
    rest_ = {};
  } else {
    const bool two_bytes = rest_[end] == '\r' && end + 1 < rest_.size() && rest_[end + 1] == '\n';
    rest_.remove_prefix(end + (two_bytes ? 2 : 1));
  }
  ++number_;
  return true;
}

std::string_view next_word(std::string_view& line) {
  const std::size_t start = line.find_first_not_of(" \t");
  if (start == std::string_view::npos) {
    line = {};
    return {};
  }
  line.remove_prefix(start);
  const std::string_view word = line.substr(0, line.find_first_of(" \t"));
  line.remove_prefix(word.size());
  return word;
}

namespace {

template <typename T>
bool parse_number(std::string_view word, T& value) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  return error == std::errc() && end == word.data() + word.size();
}

}  // namespace

bool parse(std::string_view word, double& value) {
  return parse_number(word, value) && std::isfinite(value);
}

bool parse(std::string_view word, float& value) {
  double wide = 0.0;
  if (!parse(word, wide) || std::abs(wide) > std::numeric_limits<float>::max()) return false;
  value = static_cast<float>(wide);
  return true;
}

bool parse(std::string_view word, int& value) { return parse_number(word, value); }

bool parse(std::string_view word, std::uint64_t& value) { return parse_number(word, value); }

std::string lower_extension(const std::string& path) {
  std::string extension = std::filesystem::path(path).extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension;
}

std::string quoted(std::string_view text) {
  constexpr std::size_t longest = 40;
  std::string result = "'";
  for (char c : text.substr(0, longest)) result += c >= ' ' && c < 127 ? c : '?';
  return result + (text.size() > longest ? "...'" : "'");
}

}  // namespace semblance::text
