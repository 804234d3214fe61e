#include "semblance/io/points.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "parsers.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/io/json_file.h"
#include "semblance/io/text.h"

namespace semblance {
namespace {

constexpr int most_points = 100000;

}  // namespace

/// "version: 1", "n_points: N", then N lines "x y" between braces.
std::vector<Eigen::Vector2d> parse_pts(std::string_view content, const std::string& source) {
  text::Lines lines(content);
  int declared = -1;
  bool inside = false, closed = false;
  std::vector<Eigen::Vector2d> points;
  const auto fail = [&](const std::string& what) {
    throw InvalidInput(fmt::format("{}:{}: {}", source, lines.number(), what));
  };
  for (std::string_view line; !closed && lines.next(line);) {
    const std::string_view whole = line;
    const std::string_view first = text::next_word(line), second = text::next_word(line);
    if (first.empty()) continue;
    if (first == "n_points:" && !inside) {
      if (!text::parse(second, declared) || declared < 1 || declared > most_points) {
        fail(fmt::format("'n_points' must be a number from 1 to {}", most_points));
      }
    } else if (first == "{" && !inside) {
      inside = true;
    } else if (first == "}" && inside) {
      closed = true;
    } else if (inside) {
      Eigen::Vector2d point;
      if (!text::parse(first, point.x()) || !text::parse(second, point.y()) ||
          !text::next_word(line).empty()) {
        fail(fmt::format("{} is not a point; two finite numbers were expected",
                         text::quoted(whole)));
      }
      if (static_cast<int>(points.size()) == most_points) fail("too many points");
      points.push_back(ours_from_ibug(point));
    } else if (first != "version:") {
      fail(
          fmt::format("{} was not expected; a .pts file has 'version: 1', 'n_points: N' and then "
                      "the points between braces",
                      text::quoted(whole)));
    }
  }
  if (!closed) fail("the file ends before the closing brace");
  if (declared != static_cast<int>(points.size())) {
    fail(fmt::format("{} points, but 'n_points' says {}", points.size(), declared));
  }
  return points;
}

std::vector<Eigen::Vector2d> parse_json_points(std::string_view content,
                                               const std::string& source) {
  const nlohmann::json json = parse_json(content, source);
  if (!json.is_object() || json.size() != 1 || !json.contains("points") ||
      !json["points"].is_array()) {
    throw InvalidInput(source + ": an object with the one key 'points', an array, was expected");
  }
  const nlohmann::json& list = json["points"];
  if (list.empty() || list.size() > static_cast<std::size_t>(most_points)) {
    throw InvalidInput(fmt::format("{}: 'points' has {} entries; 1 to {} were expected", source,
                                   list.size(), most_points));
  }
  std::vector<Eigen::Vector2d> points;
  for (const nlohmann::json& point : list) {
    if (!point.is_array() || point.size() != 2 || !point[0].is_number() || !point[1].is_number()) {
      throw InvalidInput(fmt::format("{}: entry {} of 'points' (from 0) must be two numbers",
                                     source, points.size()));
    }
    points.emplace_back(point[0].get<double>(), point[1].get<double>());
  }
  return points;
}

std::vector<Eigen::Vector2d> read_points(const std::string& path) {
  const std::string extension = text::lower_extension(path);
  constexpr std::uintmax_t limit_bytes = std::uintmax_t{16} << 20;
  if (extension == ".pts") return parse_pts(text::read_file(path, limit_bytes), path);
  if (extension == ".json") return parse_json_points(text::read_file(path, limit_bytes), path);
  throw InvalidInput(path + ": points are read from .pts or .json files");
}

void write_points(const std::string& path, const std::vector<Eigen::Vector2d>& points_px) {
  const std::string extension = text::lower_extension(path);
  if (extension != ".pts" && extension != ".json") {
    throw InvalidInput(path + ": points are written as .pts or .json");
  }
  AtomicFile file(path);
  if (extension == ".pts") {
    file.stream() << fmt::format("version: 1\nn_points: {}\n{{\n", points_px.size());
    for (const Eigen::Vector2d& point : points_px) {
      const Eigen::Vector2d ibug = ibug_from_ours(point);
      file.stream() << fmt::format("{} {}\n", ibug.x(), ibug.y());
    }
    file.stream() << "}\n";
  } else {
    nlohmann::ordered_json json;
    json["points"] = nlohmann::ordered_json::array();
    for (const Eigen::Vector2d& point : points_px) json["points"].push_back({point.x(), point.y()});
    file.stream() << json.dump(1) << '\n';
  }
  file.commit();
}

}  // namespace semblance
