#include "csv_rows.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

std::string_view trimmed(std::string_view field) {
  const std::size_t first = field.find_first_not_of(" \t");
  if (first == std::string_view::npos) return {};
  return field.substr(first, field.find_last_not_of(" \t") - first + 1);
}

bool is_utf8(std::string_view line) {
  const auto plain = [](char c) { return static_cast<unsigned char>(c) < 0x80; };
  if (std::all_of(line.begin(), line.end(), plain)) return true;
  try {
    nlohmann::json(std::string(line)).dump();
    return true;
  } catch (const nlohmann::json::type_error&) {
    return false;
  }
}

}  // namespace

CsvRows::CsvRows(std::string_view content, std::string source)
    : lines_(content.starts_with("\xef\xbb\xbf") ? content.substr(3) : content),
      source_(std::move(source)) {}

std::string CsvRows::place() const { return fmt::format("{}:{}", source_, lines_.number()); }

void CsvRows::fail(const std::string& what) const { throw InvalidInput(place() + ": " + what); }

bool CsvRows::next(std::vector<std::string_view>& fields) {
  constexpr std::size_t longest_line = 4096, most_fields = 256;
  constexpr int most_rows = 200000;
  fields.clear();
  for (std::string_view line; lines_.next(line);) {
    line = trimmed(line);
    if (line.empty() || line[0] == '#') continue;
    if (line.size() > longest_line) fail(fmt::format("longer than {} bytes", longest_line));
    if (++rows_ > most_rows) fail(fmt::format("more than {} rows", most_rows));
    if (!is_utf8(line)) fail("is not UTF-8; save the file in that encoding");
    if (line.find('"') != std::string_view::npos) {
      fail("quotes are not read; write names without commas and quotes");
    }
    for (std::size_t end = 0; end != std::string_view::npos;) {
      if (fields.size() == most_fields) fail(fmt::format("more than {} fields", most_fields));
      end = line.find(',');
      fields.push_back(trimmed(line.substr(0, end)));
      line.remove_prefix(end == std::string_view::npos ? line.size() : end + 1);
    }
    return true;
  }
  return false;
}

}  // namespace semblance
