#include "semblance/io/camera_io.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "camera_json.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/io/json_file.h"

namespace semblance {
namespace {

using Json = nlohmann::json;

constexpr const char* schema = "semblance.camera/1";

/// Reads one object key by key and gathers what is wrong with it.
class KeyReader {
 public:
  KeyReader(const Json& object, std::string prefix, std::vector<std::string>& problems)
      : object_(object), prefix_(std::move(prefix)), problems_(problems) {}

  bool has(const char* key) const { return object_.contains(key); }

  void problem(const std::string& key, const std::string& what) {
    problems_.push_back(fmt::format("'{}{}' {}", prefix_, key, what));
  }

  const Json* find(const char* key) {
    known_.emplace_back(key);
    const auto found = object_.find(key);
    if (found != object_.end()) return &*found;
    problem(key, "is missing");
    return nullptr;
  }

  void read_string(const char* key, std::string& value) {
    const Json* json = find(key);
    if (json == nullptr) return;
    if (json->is_string()) {
      value = json->get<std::string>();
    } else {
      problem(key, "must be a string");
    }
  }

  void read_size(const char* key, int& value) {
    constexpr int largest = 65536;
    const Json* json = find(key);
    if (json == nullptr) return;
    const double number = json->is_number_integer() ? json->get<double>() : 0.0;
    if (number >= 1.0 && number <= largest) {
      value = json->get<int>();
    } else {
      problem(key, fmt::format("must be a whole number of pixels from 1 to {}", largest));
    }
  }

  void read_numbers(const char* key, double* values, std::size_t count) {
    const Json* json = find(key);
    if (json == nullptr) return;
    const auto is_finite = [](const Json& entry) {
      return entry.is_number() && std::isfinite(entry.get<double>());
    };
    if (!json->is_array() || json->size() != count ||
        !std::all_of(json->begin(), json->end(), is_finite)) {
      problem(key, fmt::format("must be an array of {} finite numbers", count));
      return;
    }
    for (std::size_t i = 0; i < count; ++i) values[i] = (*json)[i].get<double>();
  }

  void report_unknown_keys() {
    for (const auto& [key, value] : object_.items()) {
      if (std::find(known_.begin(), known_.end(), key) == known_.end()) {
        problem(key, "is not a known key");
      }
    }
  }

 private:
  const Json& object_;
  std::string prefix_;
  std::vector<std::string>& problems_;
  std::vector<std::string> known_;
};

void read_lens(KeyReader& keys, Camera& camera) {
  std::string name(lens_name(Lens::pinhole));
  if (keys.has("lens")) keys.read_string("lens", name);
  const std::optional<Lens> lens = lens_from_name(name);
  if (!lens) {
    std::vector<std::string_view> names;
    for (const Lens known : all_lenses) names.push_back(lens_name(known));
    keys.problem("lens", fmt::format("must be one of {}", fmt::join(names, ", ")));
    if (keys.has("distortion")) keys.find("distortion");
    return;
  }
  camera.lens = *lens;
  const int count = coefficient_count(*lens);
  if (count > 0) {
    keys.read_numbers("distortion", camera.distortion.data(), static_cast<std::size_t>(count));
  }
}

void read_pose(KeyReader& keys, Camera& camera, std::vector<std::string>& problems) {
  if (!keys.has("camera_from_world")) {
    camera.camera_from_world = Camera::centred(1, 1, 1.0).camera_from_world;
    return;
  }
  const Json& pose = *keys.find("camera_from_world");
  if (!pose.is_object()) {
    keys.problem("camera_from_world", "must be an object");
    return;
  }
  KeyReader pose_keys(pose, "camera_from_world.", problems);
  Eigen::Vector4d wxyz(1, 0, 0, 0);
  pose_keys.read_numbers("rotation_wxyz", wxyz.data(), 4);
  pose_keys.read_numbers("translation_m", camera.camera_from_world.translation_m.data(), 3);
  pose_keys.report_unknown_keys();
  constexpr double tolerance = 1e-3;
  if (std::abs(wxyz.norm() - 1.0) > tolerance) {
    pose_keys.problem("rotation_wxyz", "must be a unit quaternion");
    return;
  }
  camera.camera_from_world.rotation = Eigen::Quaterniond(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
  // Figures of a whole length 1 are kept to the last bit, so that a file survives a round trip.
  if (std::abs(wxyz.norm() - 1.0) > 1e-12) camera.camera_from_world.rotation.normalize();
}

}  // namespace

nlohmann::ordered_json json_from_camera(const Camera& camera) {
  const Eigen::Quaterniond& q = camera.camera_from_world.rotation;
  const Eigen::Vector3d& t = camera.camera_from_world.translation_m;
  nlohmann::ordered_json json;
  json["schema"] = schema;
  json["name"] = camera.name;
  json["width"] = camera.width;
  json["height"] = camera.height;
  json["focal_px"] = {camera.focal_px.x(), camera.focal_px.y()};
  json["principal_px"] = {camera.principal_px.x(), camera.principal_px.y()};
  json["lens"] = lens_name(camera.lens);
  const int count = coefficient_count(camera.lens);
  if (count > 0) {
    json["distortion"] =
        std::vector<double>(camera.distortion.begin(), camera.distortion.begin() + count);
  }
  json["camera_from_world"]["rotation_wxyz"] = {q.w(), q.x(), q.y(), q.z()};
  json["camera_from_world"]["translation_m"] = {t.x(), t.y(), t.z()};
  return json;
}

Camera camera_from_json(const Json& json, const std::string& source) {
  if (!json.is_object()) throw InvalidInput(source + ": a camera must be a JSON object");
  std::vector<std::string> problems;
  KeyReader keys(json, "", problems);
  Camera camera;
  std::string found_schema = schema;
  keys.read_string("schema", found_schema);
  if (found_schema != schema) {
    keys.problem("schema", fmt::format("must be \"{}\"", schema));
  }
  if (keys.has("name")) keys.read_string("name", camera.name);
  keys.read_size("width", camera.width);
  keys.read_size("height", camera.height);
  keys.read_numbers("focal_px", camera.focal_px.data(), 2);
  keys.read_numbers("principal_px", camera.principal_px.data(), 2);
  read_lens(keys, camera);
  read_pose(keys, camera, problems);
  keys.report_unknown_keys();
  if (!problems.empty()) {
    throw InvalidInput(fmt::format("{}: not a camera as docs/formats/camera.md describes it: {}",
                                   source, fmt::join(problems, "; ")));
  }
  validate(camera, source);
  return camera;
}

Camera read_camera(const std::string& path) { return camera_from_json(read_json_file(path), path); }

void write_camera(const std::string& path, const Camera& camera) {
  validate(camera, path);
  AtomicFile file(path);
  file.stream() << json_from_camera(camera).dump(2) << '\n';
  file.commit();
}

}  // namespace semblance
