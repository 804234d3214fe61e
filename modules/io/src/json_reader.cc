#include "semblance/io/json_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "semblance/core/errors.h"
#include "semblance/io/text.h"

namespace semblance {

using Json = nlohmann::json;

JsonReader::JsonReader(const Json& in, std::string source)
    : in_(in), outermost_(*this), where_(std::move(source)) {
  if (!in.is_object()) throw InvalidInput(where_ + ": expected a JSON object {...}");
}

JsonReader::JsonReader(const Json& in, JsonReader& parent, const std::string& key)
    : in_(in),
      outermost_(parent.outermost_),
      where_(&parent == &outermost_ ? key : parent.where_ + "." + key) {
  if (!in.is_object()) outermost_.problem(where_, "expected an object {...}");
}

bool JsonReader::is_number(const char* key, const Json& entry, bool whole, double lower,
                           double upper) {
  const char* const kind = whole ? "a whole number" : "a number";
  if (!entry.is_number() || (whole && !entry.is_number_integer())) {
    problem(key, fmt::format("expected {} from {:g} to {:g}", kind, lower, upper));
    return false;
  }
  const double given = entry.get<double>();
  if (given >= lower && given <= upper) return true;
  problem(key, fmt::format("expected {} from {:g} to {:g}, not {:g}", kind, lower, upper, given));
  return false;
}

void JsonReader::text(const char* key, std::string& value, bool may_be_empty) {
  const Json* entry = find(key);
  if (entry == nullptr) return;
  if (!entry->is_string() || (entry->get<std::string>().empty() && !may_be_empty)) {
    problem(key, "expected a text");
    return;
  }
  value = entry->get<std::string>();
}

void JsonReader::flag(const char* key, bool& value) {
  const Json* entry = find(key);
  if (entry == nullptr) return;
  if (entry->is_boolean()) {
    value = entry->get<bool>();
  } else {
    problem(key, "expected true or false");
  }
}

void JsonReader::copy_numbers(const char* key, const Json& entry, double* values, int count) {
  const auto is_finite = [](const Json& number) {
    return number.is_number() && std::isfinite(number.get<double>());
  };
  if (!entry.is_array() || entry.size() != static_cast<std::size_t>(count) ||
      !std::all_of(entry.begin(), entry.end(), is_finite)) {
    problem(key, fmt::format("expected {} finite numbers [...]", count));
    return;
  }
  std::transform(entry.begin(), entry.end(), values,
                 [](const Json& number) { return number.get<double>(); });
}

const Json* JsonReader::find(const char* key) {
  known_.insert(key);
  if (!in_.is_object()) return nullptr;
  const auto it = in_.find(key);
  return it == in_.end() ? nullptr : &*it;
}

bool JsonReader::required(const char* key) {
  if (find(key) != nullptr) return true;
  problem(key, "is missing");
  return false;
}

void JsonReader::require(const char* key) {
  if (!required(key)) check();
}

void JsonReader::problem(const std::string& key, const std::string& what) {
  const std::string path = this == &outermost_ ? key : where_ + "." + key;
  outermost_.problems_.push_back(path + ": " + what);
}

void JsonReader::fail(const std::string& key, const std::string& expected) {
  problem(key, "expected " + expected);
  check();
  std::abort();  // not reached
}

void JsonReader::finish() {
  if (in_.is_object()) {
    for (const auto& [key, value] : in_.items()) {
      if (known_.count(key) != 0) continue;
      const std::string place = this == &outermost_ ? "" : where_ + ": ";
      outermost_.problems_.push_back(fmt::format("{}unknown key {}; known are {}", place,
                                                 text::quoted(key), fmt::join(known_, ", ")));
    }
  }
  if (this == &outermost_) check();
}

void JsonReader::check() const {
  // A file that is nothing like what was expected would fill the screen.
  constexpr std::size_t most = 20;
  const std::vector<std::string>& all = outermost_.problems_;
  if (all.empty()) return;
  const auto last = all.begin() + static_cast<std::ptrdiff_t>(std::min(most, all.size()));
  std::string message =
      fmt::format("{}: {}", outermost_.where_, fmt::join(all.begin(), last, "; "));
  if (all.size() > most) message += fmt::format("; and {} more", all.size() - most);
  throw InvalidInput(message);
}

}  // namespace semblance
