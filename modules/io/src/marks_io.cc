#include "semblance/io/marks_io.h"

#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>

#include "parsers.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/io/json_file.h"
#include "semblance/io/json_reader.h"
#include "semblance/io/text.h"

namespace semblance {
namespace {

using Json = nlohmann::json;

constexpr const char* kFormat = "semblance.marks/1";
constexpr std::uintmax_t kLargest_bytes = std::uintmax_t{16} << 20;
constexpr double kFarthest_m = 1e6;
constexpr double kUsualShare = 1e-3;  // deviation of a length that does not tell its own

/// An object whose keys are names.
template <int rows>
void read_named(JsonReader& in, const char* key,
                std::map<std::string, Eigen::Matrix<double, rows, 1>>& values) {
  const Json* entry = in.find(key);
  if (entry == nullptr) return;
  in.group(key, [&](JsonReader& group) {
    if (!entry->is_object()) return;
    for (const auto& [name, unused] : entry->items()) group.vector(name.c_str(), values[name]);
  });
}

void read_photo(JsonReader& in, std::set<std::string>& files, MarksFile::Photo& photo) {
  if (in.required("file")) in.text("file", photo.file);
  if (!files.insert(photo.file).second) in.problem("file", "is the same as of another photo");
  in.text("camera", photo.camera);
  read_named(in, "marks", photo.marks_px);
}

void read_name(JsonReader& in, const char* key, const std::set<std::string>& known,
               std::string& name) {
  if (!in.required(key)) return;
  in.text(key, name);
  if (known.count(name) == 0) in.problem(key, "expected the name of a point or mark");
}

MarksFile::Length read_length(JsonReader& in, const std::set<std::string>& known) {
  MarksFile::Length length;
  read_name(in, "from", known, length.from);
  read_name(in, "to", known, length.to);
  if (length.from == length.to) in.problem("to", "expected another point than 'from'");
  if (in.required("metres")) in.number("metres", length.length_m, 1e-6, kFarthest_m);
  length.sigma_m = kUsualShare * length.length_m;
  in.number("sigma_m", length.sigma_m, 1e-9, kFarthest_m);
  return length;
}

Json json_of(const Eigen::Vector2d& v) { return {v.x(), v.y()}; }
Json json_of(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

std::vector<std::string> MarksFile::names() const {
  std::set<std::string> all;
  for (const auto& [name, unused] : points_m) all.insert(name);
  for (const Photo& photo : photos) {
    for (const auto& [name, unused] : photo.marks_px) all.insert(name);
  }
  return {all.begin(), all.end()};
}

MarksFile parse_marks(std::string_view content, const std::string& source) {
  const Json json = parse_json(content, source);
  JsonReader in(json, source);
  std::string format;
  in.require("format");
  in.text("format", format);
  if (format != kFormat) in.fail("format", std::string("\"") + kFormat + "\"");
  MarksFile marks;
  read_named(in, "points", marks.points_m);
  double points_sigma_m = 0.0;
  in.number("points_sigma_m", points_sigma_m, 1e-9, kFarthest_m);
  if (points_sigma_m > 0.0) marks.points_sigma_m = points_sigma_m;
  std::set<std::string> files;
  in.require("photos");
  in.list("photos", [&](JsonReader& photo, std::size_t) {
    read_photo(photo, files, marks.photos.emplace_back());
  });
  const std::vector<std::string> names = marks.names();
  const std::set<std::string> known(names.begin(), names.end());
  in.list("lengths", [&](JsonReader& length, std::size_t) {
    marks.lengths.push_back(read_length(length, known));
  });
  if (marks.points_sigma_m && json.contains("axes")) {
    in.problem("axes", "points with a deviation are a frame already");
  }
  in.group("axes", [&](JsonReader& axes) {
    marks.axes.emplace();
    read_name(axes, "origin", known, marks.axes->origin);
    read_name(axes, "x", known, marks.axes->x);
    read_name(axes, "y", known, marks.axes->y);
    if (std::set{marks.axes->origin, marks.axes->x, marks.axes->y}.size() < 3) {
      axes.problem("y", "expected three different points");
    }
  });
  in.finish();
  return marks;
}

MarksFile read_marks(const std::string& path) {
  MarksFile marks = parse_marks(text::read_file(path, kLargest_bytes), path);
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  for (MarksFile::Photo& photo : marks.photos) photo.file = (folder / photo.file).string();
  return marks;
}

void write_marks(const std::string& path, const MarksFile& marks) {
  const std::filesystem::path folder = std::filesystem::absolute(path).parent_path();
  Json json{{"format", kFormat}, {"photos", Json::array()}};
  for (const MarksFile::Photo& photo : marks.photos) {
    const auto absolute = std::filesystem::absolute(photo.file);
    Json entry{{"file", absolute.lexically_proximate(folder).generic_string()},
               {"marks", Json::object()}};
    if (!photo.camera.empty()) entry["camera"] = photo.camera;
    for (const auto& [name, pixel] : photo.marks_px) entry["marks"][name] = json_of(pixel);
    json["photos"].push_back(std::move(entry));
  }
  for (const auto& [name, point] : marks.points_m) json["points"][name] = json_of(point);
  if (marks.points_sigma_m) json["points_sigma_m"] = *marks.points_sigma_m;
  for (const MarksFile::Length& length : marks.lengths) {
    json["lengths"].push_back({{"from", length.from},
                               {"to", length.to},
                               {"metres", length.length_m},
                               {"sigma_m", length.sigma_m}});
  }
  if (marks.axes) {
    json["axes"] = {{"origin", marks.axes->origin}, {"x", marks.axes->x}, {"y", marks.axes->y}};
  }
  AtomicFile file(path);
  file.stream() << json.dump(1) << '\n';
  file.commit();
}

}  // namespace semblance
