// Reads JSON objects field by field, with ranges, and gathers what is wrong with them.
#pragma once

#include <Eigen/Core>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <type_traits>
#include <vector>

namespace semblance {

/// One object and the objects inside it. Fields that are absent leave their value alone. Fields of
/// the wrong type or out of range, and keys that nothing asked for, are gathered; `finish` of the
/// outermost reader throws one InvalidInput that names the source and lists them all.
class JsonReader {
 public:
  /// `source` names the input in messages. Throws InvalidInput unless `in` is an object.
  JsonReader(const nlohmann::json& in, std::string source);
  JsonReader(const JsonReader&) = delete;
  JsonReader& operator=(const JsonReader&) = delete;

  template <class T>
  void number(const char* key, T& value, double lower, double upper) {
    const nlohmann::json* entry = find(key);
    if (entry == nullptr) return;
    if (is_number(key, *entry, std::is_integral_v<T>, lower, upper)) value = entry->get<T>();
  }
  void text(const char* key, std::string& value, bool may_be_empty = false);
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
  /// As many finite numbers as `value` has rows.
  template <int rows>
  void vector(const char* key, Eigen::Matrix<double, rows, 1>& value) {
    numbers(key, value.data(), rows);
  }
  /// The same for `count` numbers.
  void numbers(const char* key, double* values, int count) {
    const nlohmann::json* entry = find(key);
    if (entry != nullptr) copy_numbers(key, *entry, values, count);
  }
  /// A list of such vectors.
  template <int rows>
  void vectors(const char* key, std::vector<Eigen::Matrix<double, rows, 1>>& values) {
    const nlohmann::json* entry = find(key);
    if (entry == nullptr) return;
    if (!entry->is_array()) {
      problem(key, "expected a list of lists of " + std::to_string(rows) + " numbers");
      return;
    }
    values.assign(entry->size(), Eigen::Matrix<double, rows, 1>::Zero());
    for (std::size_t i = 0; i < entry->size(); ++i) {
      copy_numbers(key, (*entry)[i], values[i].data(), rows);
    }
  }
  template <class Body>
  void group(const char* key, const Body& body) {
    const nlohmann::json* entry = find(key);
    if (entry == nullptr) return;
    JsonReader inner(*entry, *this, key);
    body(inner);
    inner.finish();
  }
  /// Calls body(reader, index) for each object of a list.
  template <class Body>
  void list(const char* key, const Body& body) {
    const nlohmann::json* entry = find(key);
    if (entry == nullptr) return;
    if (!entry->is_array()) {
      problem(key, "expected a list of objects");
      return;
    }
    for (std::size_t i = 0; i < entry->size(); ++i) {
      JsonReader inner((*entry)[i], *this, std::string(key) + "[" + std::to_string(i) + "]");
      body(inner, i);
      inner.finish();
    }
  }
  /// The entry as it is, or null; counts as asked for.
  const nlohmann::json* find(const char* key);
  /// Notes a problem if the key is absent; tells whether it is there.
  bool required(const char* key);
  /// Throws if the key is absent: for what reading cannot go on without.
  void require(const char* key);
  /// Notes what is wrong with the value of a key.
  void problem(const std::string& key, const std::string& what);
  /// Notes that something else was expected, and throws: for what reading cannot go on without.
  [[noreturn]] void fail(const std::string& key, const std::string& expected);
  /// Throws if there were problems so far: before something is made of what was read.
  void check() const;
  /// Notes keys that nothing asked for; the outermost reader throws if there were problems.
  void finish();

 private:
  JsonReader(const nlohmann::json& in, JsonReader& parent, const std::string& key);
  bool is_number(const char* key, const nlohmann::json& entry, bool whole, double lower,
                 double upper);
  void copy_numbers(const char* key, const nlohmann::json& entry, double* values, int count);

  const nlohmann::json& in_;
  JsonReader& outermost_;
  std::string where_;  // the source; below the outermost reader the path in it
  std::set<std::string> known_;
  std::vector<std::string> problems_;  // of all readers, kept by the outermost one
};

}  // namespace semblance
