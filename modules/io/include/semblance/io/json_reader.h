// Reads JSON objects field by field, with ranges and messages that name the place.
#pragma once

#include <Eigen/Core>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <type_traits>
#include <vector>

namespace semblance {

/// One object. Fields that are absent leave their value alone; a field of the wrong type or out of
/// range, and a key that nothing asked for (`finish`), throw InvalidInput naming `where` and the
/// key.
class JsonReader {
 public:
  JsonReader(const nlohmann::json& in, std::string where);

  template <class T>
  void number(const char* key, T& value, double lower, double upper) {
    const nlohmann::json* entry = find(key);
    if (entry == nullptr) return;
    check_number(key, *entry, std::is_integral_v<T>, lower, upper);
    value = entry->get<T>();
  }
  void text(const char* key, std::string& value);
  void flag(const char* key, bool& value);
  /// One of `choices` by its name.
  template <class T>
  void choice(const char* key, const std::map<std::string, T>& choices, T& value) {
    std::string name;
    text(key, name);
    if (name.empty()) return;
    const auto found = choices.find(name);
    if (found == choices.end()) {
      std::string list;
      for (const auto& [known, unused] : choices) list += (list.empty() ? "" : ", ") + known;
      fail(key, "one of " + list);
    }
    value = found->second;
  }
  /// As many numbers as `value` has rows.
  template <int rows>
  void vector(const char* key, Eigen::Matrix<double, rows, 1>& value) {
    const nlohmann::json* entry = find(key);
    if (entry == nullptr) return;
    const std::vector<double> list = numbers(key, *entry, rows);
    for (int i = 0; i < rows; ++i) value[i] = list[i];
  }
  /// A list of such vectors.
  template <int rows>
  void vectors(const char* key, std::vector<Eigen::Matrix<double, rows, 1>>& values) {
    const nlohmann::json* entry = find(key);
    if (entry == nullptr) return;
    if (!entry->is_array()) fail(key, "a list of lists of " + std::to_string(rows) + " numbers");
    values.clear();
    for (const nlohmann::json& item : *entry) {
      const std::vector<double> list = numbers(key, item, rows);
      values.emplace_back(Eigen::Map<const Eigen::Matrix<double, rows, 1>>(list.data()));
    }
  }
  template <class Body>
  void group(const char* key, const Body& body) {
    const nlohmann::json* entry = find(key);
    if (entry == nullptr) return;
    JsonReader inner(*entry, where_ + "." + key);
    body(inner);
    inner.finish();
  }
  /// Calls body(reader, index) for each object of a list.
  template <class Body>
  void list(const char* key, const Body& body) {
    const nlohmann::json* entry = find(key);
    if (entry == nullptr) return;
    if (!entry->is_array()) fail(key, "a list of objects");
    for (std::size_t i = 0; i < entry->size(); ++i) {
      JsonReader inner((*entry)[i], where_ + "." + key + "[" + std::to_string(i) + "]");
      body(inner, i);
      inner.finish();
    }
  }
  /// Throws unless the object has the key.
  void require(const char* key);
  /// The entry as it is, or null; counts as asked for.
  const nlohmann::json* find(const char* key);
  /// Throws if the object has a key that nothing asked for.
  void finish() const;
  const std::string& where() const { return where_; }
  [[noreturn]] void fail(const std::string& key, const std::string& expected) const;

 private:
  void check_number(const char* key, const nlohmann::json& entry, bool whole, double lower,
                    double upper) const;
  std::vector<double> numbers(const char* key, const nlohmann::json& entry, int count) const;

  const nlohmann::json& in_;
  std::string where_;
  std::set<std::string> known_;
};

}  // namespace semblance
