#include "semblance/io/json_reader.h"

#include <fmt/format.h>

#include <cmath>

#include "semblance/core/errors.h"

namespace semblance {

using Json = nlohmann::json;

JsonReader::JsonReader(const Json& in, std::string where) : in_(in), where_(std::move(where)) {
  if (!in.is_object()) throw InvalidInput(where_ + ": expected an object {...}");
}

void JsonReader::check_number(const char* key, const Json& entry, bool whole, double lower,
                              double upper) const {
  if (!entry.is_number() || (whole && !entry.is_number_integer())) {
    fail(key, whole ? "a whole number" : "a number");
  }
  const double given = entry.get<double>();
  if (!(given >= lower && given <= upper)) {
    fail(key, fmt::format("a number from {:g} to {:g}, not {:g}", lower, upper, given));
  }
}

void JsonReader::text(const char* key, std::string& value) {
  const Json* entry = find(key);
  if (entry == nullptr) return;
  if (!entry->is_string() || entry->get<std::string>().empty()) fail(key, "a text");
  value = entry->get<std::string>();
}

void JsonReader::flag(const char* key, bool& value) {
  const Json* entry = find(key);
  if (entry == nullptr) return;
  if (!entry->is_boolean()) fail(key, "true or false");
  value = entry->get<bool>();
}

std::vector<double> JsonReader::numbers(const char* key, const Json& entry, int count) const {
  std::vector<double> values;
  if (entry.is_array() && entry.size() == static_cast<std::size_t>(count)) {
    for (const Json& number : entry) {
      if (number.is_number() && std::isfinite(number.get<double>())) {
        values.push_back(number.get<double>());
      }
    }
  }
  if (static_cast<int>(values.size()) != count) {
    fail(key, fmt::format("{} finite numbers [...]", count));
  }
  return values;
}

void JsonReader::require(const char* key) {
  if (find(key) == nullptr) throw InvalidInput(fmt::format("{}: '{}' is missing", where_, key));
}

const Json* JsonReader::find(const char* key) {
  known_.insert(key);
  const auto it = in_.find(key);
  return it == in_.end() ? nullptr : &*it;
}

void JsonReader::finish() const {
  for (const auto& [key, value] : in_.items()) {
    if (known_.count(key) != 0) continue;
    throw InvalidInput(
        fmt::format("{}: unknown key '{}'; known are {}", where_, key, fmt::join(known_, ", ")));
  }
}

void JsonReader::fail(const std::string& key, const std::string& expected) const {
  throw InvalidInput(fmt::format("{}.{}: expected {}", where_, key, expected));
}

}  // namespace semblance
