#include "dictionaries.h"

#include <array>

namespace semblance {

namespace {

struct NamedDictionary {
  const char* name;
  cv::aruco::PREDEFINED_DICTIONARY_NAME number;
  int size;
};

#define SEMBLANCE_DICTIONARY(name, size) \
  NamedDictionary { #name, cv::aruco::name, size }
constexpr std::array<NamedDictionary, 21> kDictionaries = {
    SEMBLANCE_DICTIONARY(DICT_4X4_50, 50),
    SEMBLANCE_DICTIONARY(DICT_4X4_100, 100),
    SEMBLANCE_DICTIONARY(DICT_4X4_250, 250),
    SEMBLANCE_DICTIONARY(DICT_4X4_1000, 1000),
    SEMBLANCE_DICTIONARY(DICT_5X5_50, 50),
    SEMBLANCE_DICTIONARY(DICT_5X5_100, 100),
    SEMBLANCE_DICTIONARY(DICT_5X5_250, 250),
    SEMBLANCE_DICTIONARY(DICT_5X5_1000, 1000),
    SEMBLANCE_DICTIONARY(DICT_6X6_50, 50),
    SEMBLANCE_DICTIONARY(DICT_6X6_100, 100),
    SEMBLANCE_DICTIONARY(DICT_6X6_250, 250),
    SEMBLANCE_DICTIONARY(DICT_6X6_1000, 1000),
    SEMBLANCE_DICTIONARY(DICT_7X7_50, 50),
    SEMBLANCE_DICTIONARY(DICT_7X7_100, 100),
    SEMBLANCE_DICTIONARY(DICT_7X7_250, 250),
    SEMBLANCE_DICTIONARY(DICT_7X7_1000, 1000),
    SEMBLANCE_DICTIONARY(DICT_ARUCO_ORIGINAL, 1024),
    SEMBLANCE_DICTIONARY(DICT_APRILTAG_16h5, 30),
    SEMBLANCE_DICTIONARY(DICT_APRILTAG_25h9, 35),
    SEMBLANCE_DICTIONARY(DICT_APRILTAG_36h10, 2320),
    SEMBLANCE_DICTIONARY(DICT_APRILTAG_36h11, 587)};
#undef SEMBLANCE_DICTIONARY

const NamedDictionary* find(const std::string& name) {
  for (const NamedDictionary& d : kDictionaries) {
    if (name == d.name) return &d;
  }
  return nullptr;
}

}  // namespace

std::vector<std::string> dictionary_names() {
  std::vector<std::string> names;
  for (const NamedDictionary& d : kDictionaries) names.emplace_back(d.name);
  return names;
}

std::optional<int> dictionary_size(const std::string& name) {
  const NamedDictionary* found = find(name);
  return found ? std::optional(found->size) : std::nullopt;
}

cv::Ptr<cv::aruco::Dictionary> dictionary_of(const std::string& name) {
  return cv::aruco::getPredefinedDictionary(find(name)->number);
}

}  // namespace semblance
