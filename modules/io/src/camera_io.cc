#include "semblance/io/camera_io.h"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "camera_json.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/io/json_file.h"
#include "semblance/io/json_reader.h"
#include "semblance/io/text.h"

namespace semblance {
namespace {

using Json = nlohmann::json;

constexpr const char* camera_schema = "semblance.camera/1";
constexpr const char* rig_schema = "semblance.rig/1";
constexpr std::size_t most_cameras = 10000;

void read_schema(JsonReader& in, const char* schema) {
  std::string found;
  if (!in.required("schema")) return;
  in.text("schema", found);
  if (found != schema) in.problem("schema", fmt::format("expected \"{}\"", schema));
}

void read_lens(JsonReader& in, Camera& camera) {
  std::string name(lens_name(Lens::pinhole));
  in.text("lens", name);
  const std::optional<Lens> lens = lens_from_name(name);
  if (!lens) {
    std::vector<std::string_view> names;
    for (const Lens known : all_lenses) names.push_back(lens_name(known));
    in.problem("lens", fmt::format("expected one of {}", fmt::join(names, ", ")));
    in.find("distortion");  // not unknown, only without a meaning
    return;
  }
  camera.lens = *lens;
  const int count = coefficient_count(*lens);
  if (count > 0 && in.required("distortion")) {
    in.numbers("distortion", camera.distortion.data(), count);
  }
}

void read_pose(JsonReader& in, Rigid3& camera_from_world) {
  Eigen::Vector4d wxyz(1, 0, 0, 0);
  if (in.required("rotation_wxyz")) in.vector("rotation_wxyz", wxyz);
  if (in.required("translation_m")) in.vector("translation_m", camera_from_world.translation_m);
  constexpr double tolerance = 1e-3;
  if (std::abs(wxyz.norm() - 1.0) > tolerance) {
    in.problem("rotation_wxyz", "expected a unit quaternion");
    return;
  }
  camera_from_world.rotation = Eigen::Quaterniond(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
  // Figures of a whole length 1 are kept to the last bit, so that a file survives a round trip.
  if (std::abs(wxyz.norm() - 1.0) > 1e-12) camera_from_world.rotation.normalize();
}

Camera read_camera_keys(JsonReader& in) {
  constexpr int largest_px = 65536;
  Camera camera;
  read_schema(in, camera_schema);
  in.text("name", camera.name, true);
  if (in.required("width")) in.number("width", camera.width, 1, largest_px);
  if (in.required("height")) in.number("height", camera.height, 1, largest_px);
  if (in.required("focal_px")) in.vector("focal_px", camera.focal_px);
  if (in.required("principal_px")) in.vector("principal_px", camera.principal_px);
  read_lens(in, camera);
  camera.camera_from_world = Camera::centred(1, 1, 1.0).camera_from_world;
  in.group("camera_from_world",
           [&](JsonReader& pose) { read_pose(pose, camera.camera_from_world); });
  return camera;
}

void write_json(const std::string& path, const nlohmann::ordered_json& json) {
  AtomicFile file(path);
  try {
    file.stream() << json.dump(2) << '\n';
  } catch (const Json::type_error&) {
    throw InvalidInput(path + ": cannot be written: a camera's name is not UTF-8; rename it");
  }
  file.commit();
}

}  // namespace

nlohmann::ordered_json json_from_camera(const Camera& camera) {
  const Eigen::Quaterniond& q = camera.camera_from_world.rotation;
  const Eigen::Vector3d& t = camera.camera_from_world.translation_m;
  nlohmann::ordered_json json;
  json["schema"] = camera_schema;
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
  JsonReader in(json, source);
  const Camera camera = read_camera_keys(in);
  in.finish();
  validate(camera, source);
  return camera;
}

CameraRig rig_from_json(const Json& json, const std::string& source) {
  if (json.is_object() && json.value("schema", Json()) == camera_schema) {
    return {{camera_from_json(json, source)}};
  }
  JsonReader in(json, source);
  read_schema(in, rig_schema);
  CameraRig rig;
  in.required("cameras");
  in.list("cameras", [&](JsonReader& inner, std::size_t i) {
    if (i == most_cameras) in.fail("cameras", fmt::format("at most {} cameras", most_cameras));
    rig.cameras.push_back(read_camera_keys(inner));
  });
  in.finish();
  validate(rig, source);
  return rig;
}

void validate(const CameraRig& rig, const std::string& source) {
  if (rig.cameras.empty()) throw InvalidInput(source + ": holds no camera");
  std::set<std::string> names;
  for (const Camera& camera : rig.cameras) {
    validate(camera, source);
    if (names.insert(camera.name).second) continue;
    throw InvalidInput(fmt::format("{}: two cameras are called {}; give each a name of its own",
                                   source, text::quoted(camera.name)));
  }
}

Camera read_camera(const std::string& path) { return camera_from_json(read_json_file(path), path); }

void write_camera(const std::string& path, const Camera& camera) {
  validate(camera, path);
  write_json(path, json_from_camera(camera));
}

CameraRig read_rig(const std::string& path) { return rig_from_json(read_json_file(path), path); }

void write_rig(const std::string& path, const CameraRig& rig) {
  validate(rig, path);
  nlohmann::ordered_json json;
  json["schema"] = rig_schema;
  for (const Camera& camera : rig.cameras) json["cameras"].push_back(json_from_camera(camera));
  write_json(path, json);
}

}  // namespace semblance
