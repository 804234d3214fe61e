#include "semblance/io/json_file.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>
#include <vector>

#include "semblance/core/errors.h"
#include "semblance/io/text.h"

namespace semblance {
namespace {

/// Reading and destroying deeply nested values would take the stack.
void check_depth(std::string_view text, const std::string& source) {
  constexpr int deepest = 64;
  int depth = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string) {
      if (c == '\\') ++i;
      in_string = c != '"';
    } else if (c == '"') {
      in_string = true;
    } else if (c == '[' || c == '{') {
      if (++depth > deepest) {
        throw InvalidInput(source + ": nests deeper than 64 levels; no file read here does");
      }
    } else if (c == ']' || c == '}') {
      --depth;
    }
  }
}

/// Where byte `offset` of the text is, as "line 3, column 7".
std::string place(std::string_view text, std::size_t offset) {
  const std::string_view before = text.substr(0, std::min(offset, text.size()));
  const auto line = std::count(before.begin(), before.end(), '\n') + 1;
  const std::size_t start = before.rfind('\n');
  const std::size_t column =
      start == std::string_view::npos ? before.size() : before.size() - start - 1;
  return "line " + std::to_string(line) + ", column " + std::to_string(column);
}

}  // namespace

nlohmann::json parse_json(std::string_view text, const std::string& source) {
  check_depth(text, source);
  std::vector<std::set<std::string>> keys;
  std::string repeated;
  const auto watch_keys = [&](int, nlohmann::json::parse_event_t event, nlohmann::json& value) {
    using Event = nlohmann::json::parse_event_t;
    if (event == Event::object_start) keys.emplace_back();
    if (event == Event::object_end) keys.pop_back();
    if (event == Event::key && !keys.back().insert(value.get<std::string>()).second) {
      repeated = value.get<std::string>();
    }
    return true;
  };
  nlohmann::json result;
  try {
    result = nlohmann::json::parse(text, watch_keys);
  } catch (const nlohmann::json::parse_error& error) {
    throw InvalidInput(source + ": is not valid JSON at " + place(text, error.byte) +
                       " (JSON knows no NaN, Infinity, comments or trailing commas)");
  } catch (const nlohmann::json::exception& error) {
    throw InvalidInput(source + ": is not valid JSON: a number is out of range");
  }
  if (!repeated.empty()) {
    throw InvalidInput(source + ": the key " + text::quoted(repeated) + " is given twice");
  }
  return result;
}

nlohmann::json read_json_file(const std::string& path) {
  return parse_json(text::read_file(path, std::uintmax_t{256} << 20), path);
}

}  // namespace semblance
