#include "semblance/io/marker_points.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <set>

#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/io/json_file.h"
#include "semblance/io/json_reader.h"

namespace semblance {
namespace {

constexpr const char* kSchema = "semblance.marker_points/1";
constexpr std::size_t kMostPoints = 10000;
constexpr double kFarthest_m = 1e4;

MarkerPoint read_point(JsonReader& in) {
  MarkerPoint point;
  if (in.required("name")) in.text("name", point.name);
  if (in.required("position_m")) in.vector("position_m", point.position_m);
  if (in.find("radius_m") != nullptr) {
    in.number("radius_m", point.radius_m.emplace(), 1e-6, kFarthest_m);
  }
  if (in.find("normal") != nullptr) {
    in.vector("normal", point.normal.emplace(Eigen::Vector3d::Zero()));
    const double length = point.normal->norm();
    if (!(length > 1e-6)) in.problem("normal", "expected a vector that is not zero");
    *point.normal /= length;
  }
  if (in.find("sigma_m") != nullptr) {
    in.vector("sigma_m", point.sigma_m.emplace(Eigen::Vector3d::Zero()));
  }
  if (!(point.position_m.cwiseAbs().maxCoeff() <= kFarthest_m)) {
    in.problem("position_m", fmt::format("expected metres, at most {}", kFarthest_m));
  }
  return point;
}

nlohmann::ordered_json array_of(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

std::vector<MarkerPoint> marker_points_from_json(const nlohmann::json& json,
                                                 const std::string& source) {
  JsonReader in(json, source);
  std::string schema;
  if (in.required("schema")) in.text("schema", schema);
  if (schema != kSchema) in.problem("schema", fmt::format("expected \"{}\"", kSchema));
  in.require("points");
  const nlohmann::json& list = *in.find("points");
  if (list.is_array() && list.size() > kMostPoints) {
    in.fail("points", fmt::format("at most {} points", kMostPoints));
  }
  std::vector<MarkerPoint> points;
  std::set<std::string> names;
  in.list("points", [&](JsonReader& entry, std::size_t) {
    points.push_back(read_point(entry));
    if (!points.back().name.empty() && !names.insert(points.back().name).second) {
      entry.problem("name", fmt::format("'{}' is the name of another point", points.back().name));
    }
  });
  in.finish();
  return points;
}

std::vector<MarkerPoint> read_marker_points(const std::string& path) {
  return marker_points_from_json(read_json_file(path), path);
}

void write_marker_points(const std::string& path, const std::vector<MarkerPoint>& points) {
  nlohmann::ordered_json json{{"schema", kSchema}, {"points", nlohmann::ordered_json::array()}};
  for (const MarkerPoint& point : points) {
    nlohmann::ordered_json entry{{"name", point.name}, {"position_m", array_of(point.position_m)}};
    if (point.radius_m) entry["radius_m"] = *point.radius_m;
    if (point.normal) entry["normal"] = array_of(*point.normal);
    if (point.sigma_m) entry["sigma_m"] = array_of(*point.sigma_m);
    json["points"].push_back(std::move(entry));
  }
  AtomicFile file(path);
  file.stream() << json.dump(1) << '\n';
  file.commit();
}

}  // namespace semblance
