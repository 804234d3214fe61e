// Rows of small CSV files: comma-separated, no quotes, '#' begins a comment line.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "semblance/io/text.h"

namespace semblance {

/// Rows one by one. Bounded: lines of 4096 bytes, 256 fields, 200,000 rows.
class CsvRows {
 public:
  CsvRows(std::string_view content, std::string source);

  /// The fields of the next row that is neither blank nor a comment, without the blanks around
  /// them; false at the end.
  bool next(std::vector<std::string_view>& fields);
  /// Throws InvalidInput that begins with file and line.
  [[noreturn]] void fail(const std::string& what) const;
  /// "file:line".
  std::string place() const;

 private:
  text::Lines lines_;
  std::string source_;
  int rows_ = 0;
};

}  // namespace semblance
