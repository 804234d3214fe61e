#include "semblance/io/visemes.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <set>

#include "parsers.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/io/json_file.h"
#include "semblance/io/text.h"

namespace semblance {
namespace {

constexpr std::size_t most_visemes = 1000, longest_name = 64;
constexpr double farthest_m = 1.0;
constexpr const char* schema = "semblance.visemes/1";

Eigen::Vector3d parse_marker(const nlohmann::json& json, const std::string& place) {
  Eigen::Vector3d marker;
  if (!json.is_array() || json.size() != 3) {
    throw InvalidInput(place + ": three coordinates [x, y, z] were expected");
  }
  for (int k = 0; k < 3; ++k) {
    if (!json[k].is_number()) throw InvalidInput(place + ": a coordinate is not a number");
    marker[k] = json[k].get<double>();
    if (!(std::abs(marker[k]) <= farthest_m)) {
      throw InvalidInput(
          fmt::format("{}: {} is more than {} m from the face's origin; coordinates "
                      "are in metres (divide millimetres by 1000)",
                      place, marker[k], farthest_m));
    }
  }
  return marker;
}

Viseme parse_viseme(const nlohmann::json& json, const std::string& place) {
  if (!json.is_object() || json.size() != 2 || !json.contains("name") ||
      !json.contains("markers_m") || !json["name"].is_string() || !json["markers_m"].is_array()) {
    throw InvalidInput(place + ": an object with the keys 'name' and 'markers_m' was expected");
  }
  Viseme viseme;
  viseme.name = json["name"].get<std::string>();
  if (viseme.name.empty() || viseme.name.size() > longest_name) {
    throw InvalidInput(fmt::format("{}: 'name' must have 1 to {} bytes", place, longest_name));
  }
  const nlohmann::json& list = json["markers_m"];
  if (list.size() != static_cast<std::size_t>(Viseme::marker_count)) {
    throw InvalidInput(fmt::format("{}: {} markers; {} were expected (docs/formats/visemes.md)",
                                   place, list.size(), Viseme::marker_count));
  }
  for (const nlohmann::json& marker : list) {
    viseme.markers_m.push_back(
        parse_marker(marker, fmt::format("{}, marker {}", place, viseme.markers_m.size())));
  }
  if (!(viseme.markers_m[0].x() < viseme.markers_m[4].x())) {
    throw InvalidInput(place +
                       ": marker 0 must be the corner of the mouth on the face's own right, and "
                       "marker 4 the other one (x runs to the face's left)");
  }
  return viseme;
}

}  // namespace

std::vector<Viseme> parse_visemes(std::string_view content, const std::string& source) {
  const nlohmann::json json = parse_json(content, source);
  if (!json.is_object() || json.size() != 2 || !json.contains("schema") ||
      json["schema"] != schema || !json.contains("visemes") || !json["visemes"].is_array()) {
    throw InvalidInput(
        fmt::format("{}: an object with the keys 'schema' (\"{}\") and 'visemes', "
                    "an array, was expected (docs/formats/visemes.md)",
                    source, schema));
  }
  const nlohmann::json& list = json["visemes"];
  if (list.empty() || list.size() > most_visemes) {
    throw InvalidInput(fmt::format("{}: 'visemes' has {} entries; 1 to {} were expected", source,
                                   list.size(), most_visemes));
  }
  std::vector<Viseme> visemes;
  std::set<std::string> names;
  for (const nlohmann::json& entry : list) {
    const std::string place = fmt::format("{}: viseme {} (from 0)", source, visemes.size());
    visemes.push_back(parse_viseme(entry, place));
    if (!names.insert(visemes.back().name).second) {
      throw InvalidInput(
          fmt::format("{}: the name {} is given twice", place, text::quoted(visemes.back().name)));
    }
  }
  return visemes;
}

std::vector<Viseme> read_visemes(const std::string& path) {
  constexpr std::uintmax_t limit_bytes = std::uintmax_t{16} << 20;
  return parse_visemes(text::read_file(path, limit_bytes), path);
}

void write_visemes(const std::string& path, const std::vector<Viseme>& visemes) {
  nlohmann::ordered_json json{{"schema", schema}, {"visemes", nlohmann::ordered_json::array()}};
  for (const Viseme& viseme : visemes) {
    nlohmann::ordered_json markers = nlohmann::ordered_json::array();
    for (const Eigen::Vector3d& m : viseme.markers_m) markers.push_back({m.x(), m.y(), m.z()});
    json["visemes"].push_back({{"name", viseme.name}, {"markers_m", markers}});
  }
  AtomicFile file(path);
  file.stream() << json.dump(1) << '\n';
  file.commit();
}

}  // namespace semblance
