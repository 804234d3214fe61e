// Qualisys's .qca.txt: XML with lengths in millimetres and pixels in 64ths.
//
// The rows of the rotation are the camera's axes in the world: x right, y up, z backwards; x, y, z
// is the camera's place. The sensor of a W pixels wide camera ranges from 0 to 64 W - 1 in 64ths,
// so pixel i has 64 i to 64 i + 63 and, like ours, its centre at i + 0.5.
#include <fmt/format.h>

#include <cmath>
#include <cstring>
#include <pugixml.hpp>
#include <sstream>

#include "camera_format.h"
#include "parsers.h"
#include "semblance/core/errors.h"
#include "semblance/io/text.h"

namespace semblance {
namespace {

constexpr double units_per_pixel = 64.0;  // as written; as read it follows from the sensor's range
constexpr double metres_per_mm = 1e-3;

/// Qualisys's axes (x right, y up, z backwards) from ours.
const Eigen::DiagonalMatrix<double, 3> flip(1.0, -1.0, -1.0);

/// An element of one camera with the place for messages.
class Element {
 public:
  Element(const pugi::xml_node& camera, const char* name, std::string where)
      : node_(camera.child(name)), where_(fmt::format("{}: <{}>", where, name)) {
    if (!node_) throw InvalidInput(where_ + " is missing");
  }
  double number(const char* attribute) const {
    const pugi::xml_attribute found = node_.attribute(attribute);
    double value = 0.0;
    if (!found || !text::parse(found.value(), value)) {
      throw InvalidInput(fmt::format("{}: {}: expected a finite number", where_, attribute));
    }
    return value;
  }
  [[noreturn]] void fail(const std::string& what) const {
    throw InvalidInput(where_ + ": " + what);
  }

 private:
  pugi::xml_node node_;
  std::string where_;
};

/// 64, or whatever whole number of units the sensor has per pixel.
double sensor_units_per_pixel(const Element& sensor, const Element& whole, char axis) {
  const bool u = axis == 'U';
  const double pixels = u ? whole.number("right") - whole.number("left")
                          : whole.number("bottom") - whole.number("top");
  const double units = sensor.number(u ? "sensorMaxU" : "sensorMaxV") -
                       sensor.number(u ? "sensorMinU" : "sensorMinV");
  // Both ranges are from the first to the last: 64 W - 1 units over W - 1 pixels. Files that other
  // programs have turned have 64 (W - 1).
  for (const double ratio : {(units + 1.0) / (pixels + 1.0), units / pixels}) {
    const double nearest = std::round(ratio);
    if (pixels >= 1.0 && nearest >= 1.0 && std::abs(ratio - nearest) < 1e-3) return nearest;
  }
  sensor.fail(
      fmt::format("the sensor's range {} is not a whole number of units per pixel of "
                  "<fov_video_max>",
                  axis));
}

Rigid3 read_pose(const Element& transform, const std::string& source, const std::string& name) {
  Eigen::Matrix3d rows;
  const char* const entries[] = {"r11", "r12", "r13", "r21", "r22", "r23", "r31", "r32", "r33"};
  for (int i = 0; i < 9; ++i) rows(i / 3, i % 3) = transform.number(entries[i]);
  const Eigen::Vector3d place_m =
      metres_per_mm *
      Eigen::Vector3d(transform.number("x"), transform.number("y"), transform.number("z"));
  Rigid3 camera_from_world;
  camera_from_world.rotation = rotation_from_matrix(flip * rows, source, name);
  camera_from_world.translation_m = -(camera_from_world.rotation * place_m);
  return camera_from_world;
}

void read_intrinsics(const Element& sensor, const Element& field, const Element& whole,
                     Camera& camera) {
  const double u = sensor_units_per_pixel(sensor, whole, 'U');
  const double v = sensor_units_per_pixel(sensor, whole, 'V');
  if (sensor.number("skew") != 0.0) sensor.fail("skew: expected 0; no lens here has a skew");
  const Eigen::Vector2d corner(field.number("left"), field.number("top"));
  camera.focal_px << sensor.number("focalLengthU") / u, sensor.number("focalLengthV") / v;
  camera.principal_px << (sensor.number("centerPointU") - sensor.number("sensorMinU")) / u,
      (sensor.number("centerPointV") - sensor.number("sensorMinV")) / v;
  camera.principal_px -= corner;
  set_brown_lens(camera,
                 {sensor.number("radialDistortion1"), sensor.number("radialDistortion2"),
                  sensor.number("tangentalDistortion1"), sensor.number("tangentalDistortion2"),
                  sensor.number("radialDistortion3"), 0.0, 0.0, 0.0});
}

int pixels_between(const Element& field, const char* first, const char* last) {
  const double pixels = field.number(last) - field.number(first) + 1.0;
  if (!(pixels >= 1.0 && pixels <= 65536.0) || pixels != std::floor(pixels)) {
    field.fail(fmt::format("{} to {}: expected 1 to 65536 whole pixels", first, last));
  }
  return static_cast<int>(pixels);
}

Camera read_camera_element(const pugi::xml_node& node, const std::string& source,
                           std::vector<std::string>& notes) {
  Camera camera;
  camera.name = node.attribute("serial").value();
  if (camera.name.empty()) throw InvalidInput(source + ": <camera> has no serial, its name");
  const std::string where = source + ": camera " + text::quoted(camera.name);
  const Element field(node, "fov_video", where), whole(node, "fov_video_max", where);
  camera.width = pixels_between(field, "left", "right");
  camera.height = pixels_between(field, "top", "bottom");
  read_intrinsics(Element(node, "intrinsic", where), field, whole, camera);
  camera.camera_from_world = read_pose(Element(node, "transform", where), source, camera.name);
  const char* const turn = node.attribute("viewrotation").value();
  if (std::strcmp(turn, "") != 0 && std::strcmp(turn, "0") != 0) {
    notes.push_back(
        fmt::format("{} is shown turned by {} degrees: the camera is that of the "
                    "picture before it is turned",
                    text::quoted(camera.name), text::quoted(turn)));
  }
  return camera;
}

bool ends_with(const std::string& path, std::string_view end) {
  return path.size() >= end.size() && path.compare(path.size() - end.size(), end.size(), end) == 0;
}

bool recognises(const std::string&, std::string_view content) {
  return content.find("<calibration") != std::string_view::npos &&
         content.find("tangentalDistortion1") != std::string_view::npos;
}

bool suits(const std::string& path) {
  return ends_with(path, ".qca.txt") || ends_with(path, ".qca");
}

CameraFile read(const std::string& path) {
  return parse_qualisys(text::read_file(path, camera_file_limit_bytes), path);
}

void set_number(pugi::xml_node& node, const char* attribute, double value) {
  // The shortest text that reads back to the same bits.
  node.append_attribute(attribute).set_value(fmt::format("{}", value + 0.0).c_str());  // no -0
}

void write_field(pugi::xml_node& camera, const char* name, const Camera& given) {
  pugi::xml_node field = camera.append_child(name);
  field.append_attribute("left") = 0;
  field.append_attribute("top") = 0;
  field.append_attribute("right") = given.width - 1;
  field.append_attribute("bottom") = given.height - 1;
}

void write_transform(pugi::xml_node& camera, const Rigid3& camera_from_world) {
  pugi::xml_node transform = camera.append_child("transform");
  const Eigen::Vector3d place_mm = camera_from_world.inverse().translation_m / metres_per_mm;
  set_number(transform, "x", place_mm.x());
  set_number(transform, "y", place_mm.y());
  set_number(transform, "z", place_mm.z());
  const Eigen::Matrix3d rows = flip * camera_from_world.rotation.toRotationMatrix();
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      set_number(transform, fmt::format("r{}{}", r + 1, c + 1).c_str(), rows(r, c));
    }
  }
}

void write_intrinsic(pugi::xml_node& camera, const Camera& given) {
  pugi::xml_node node = camera.append_child("intrinsic");
  const LensCoefficients& k = given.distortion;
  set_number(node, "focallength", 0.0);  // in mm, which a camera in pixels does not have
  set_number(node, "sensorMinU", 0.0);
  set_number(node, "sensorMaxU", units_per_pixel * given.width - 1.0);
  set_number(node, "sensorMinV", 0.0);
  set_number(node, "sensorMaxV", units_per_pixel * given.height - 1.0);
  set_number(node, "focalLengthU", units_per_pixel * given.focal_px.x());
  set_number(node, "focalLengthV", units_per_pixel * given.focal_px.y());
  set_number(node, "centerPointU", units_per_pixel * given.principal_px.x());
  set_number(node, "centerPointV", units_per_pixel * given.principal_px.y());
  set_number(node, "skew", 0.0);
  set_number(node, "radialDistortion1", k[0]);
  set_number(node, "radialDistortion2", k[1]);
  set_number(node, "radialDistortion3", k[4]);
  set_number(node, "tangentalDistortion1", k[2]);
  set_number(node, "tangentalDistortion2", k[3]);
}

void write_camera_element(pugi::xml_node& cameras, const Camera& given, const std::string& path) {
  if (given.lens == Lens::brown8 || given.lens == Lens::fisheye) {
    refuse_lens(path, given, "qualisys", "pinhole, brown2, brown5");
  }
  pugi::xml_node camera = cameras.append_child("camera");
  camera.append_attribute("active") = 1;
  camera.append_attribute("serial") = given.name.c_str();
  camera.append_attribute("model") = "none";
  camera.append_attribute("viewrotation") = 0;
  for (const char* name : {"fov_marker", "fov_marker_max", "fov_video", "fov_video_max"}) {
    write_field(camera, name, given);
  }
  write_transform(camera, given.camera_from_world);
  write_intrinsic(camera, given);
}

std::vector<std::string> write(const std::string& path, const CameraFile& file) {
  pugi::xml_document document;
  pugi::xml_node calibration = document.append_child("calibration");
  calibration.append_attribute("type") = "regular";
  pugi::xml_node cameras = calibration.append_child("cameras");
  for (const Camera& camera : file.rig.cameras) write_camera_element(cameras, camera, path);
  std::ostringstream stream;
  document.save(stream, "  ");
  write_whole(path, stream.str());
  return {"the focal length in millimetres is not known and written as 0"};
}

}  // namespace

CameraFile parse_qualisys(std::string_view content, const std::string& source) {
  pugi::xml_document document;
  const pugi::xml_parse_result result = document.load_buffer(content.data(), content.size());
  if (!result) {
    throw InvalidInput(fmt::format("{}: is not valid XML at byte {}: {}", source, result.offset,
                                   result.description()));
  }
  CameraFile file;
  for (const pugi::xml_node& node :
       document.child("calibration").child("cameras").children("camera")) {
    if (file.rig.cameras.size() == most_rig_cameras) {
      throw InvalidInput(fmt::format("{}: has more than {} cameras", source, most_rig_cameras));
    }
    file.rig.cameras.push_back(read_camera_element(node, source, file.notes));
  }
  if (file.rig.cameras.empty()) {
    throw InvalidInput(source + ": has no <camera> in <calibration><cameras>");
  }
  file.notes.emplace_back("not kept: residuals, point counts, marker fields");
  return file;
}

const CameraFormat qualisys_format{.name = "qualisys",
                                   .title = "Qualisys .qca.txt",
                                   .recognises = recognises,
                                   .suits = suits,
                                   .read = read,
                                   .write = write};

}  // namespace semblance
