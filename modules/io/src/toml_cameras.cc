// Cameras in TOML: aniposelib's calibration.toml and Caliscope's camera_array.toml. Both keep what
// OpenCV's functions take, one table per camera; rotations are vectors or matrices.
#include <fmt/format.h>

#include <toml++/toml.h>
#include <algorithm>
#include <cmath>
#include <sstream>

#include "camera_format.h"
#include "parsers.h"
#include "semblance/core/errors.h"
#include "semblance/io/text.h"

namespace semblance {
namespace {

struct Table {
  std::string key;  // "cam_0"
  const toml::table* content;
};

/// One camera's table with the place for messages.
class TableReader {
 public:
  TableReader(const Table& table, const std::string& source) : table_(table), source_(source) {}

  bool has(const char* key) {
    used_.insert(key);
    return table_.content->contains(key);
  }

  [[noreturn]] void fail(const char* key, const std::string& expected) const {
    throw InvalidInput(
        fmt::format("{}: [{}] {}: expected {}", source_, text::quoted(table_.key), key, expected));
  }

  /// A list of numbers, or of lists of numbers, one after the other.
  std::vector<double> numbers(const char* key) {
    std::vector<double> values;
    if (!has(key)) fail(key, "a list of numbers, but it is missing");
    const toml::array* list = table_.content->get(key)->as_array();
    if (list == nullptr) fail(key, "a list of numbers");
    for (const toml::node& node : *list) {
      if (const toml::array* row = node.as_array()) {
        for (const toml::node& entry : *row) values.push_back(number(key, entry));
      } else {
        values.push_back(number(key, node));
      }
    }
    return values;
  }
  std::vector<double> numbers(const char* key, std::size_t count) {
    std::vector<double> values = numbers(key);
    if (values.size() != count) fail(key, fmt::format("{} numbers", count));
    return values;
  }

  bool flag(const char* key) {
    if (!has(key)) return false;
    const auto value = table_.content->get(key)->value<bool>();
    if (!value) fail(key, "true or false");
    return *value;
  }

  /// A text, or a whole number as text.
  std::string text_or_number(const char* key) {
    const toml::node* node = table_.content->get(key);
    used_.insert(key);
    if (const auto value = node->value<std::string>()) return *value;
    if (const auto value = node->value<std::int64_t>()) return std::to_string(*value);
    fail(key, "a text or a whole number");
  }

  void add_unused(std::set<std::string>& unused) const {
    for (const auto& [key, node] : *table_.content) {
      const std::string name(key.str());
      if (used_.count(name) == 0) unused.insert(text::quoted(name));
    }
  }

 private:
  double number(const char* key, const toml::node& node) const {
    const auto value = node.value<double>();
    if (!value || !std::isfinite(*value)) fail(key, "finite numbers");
    return *value;
  }

  const Table& table_;
  const std::string& source_;
  std::set<std::string> used_;
};

Eigen::Matrix3d row_major(const std::vector<double>& values) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(values.data());
}

Eigen::Quaterniond read_rotation(TableReader& in, const std::string& source,
                                 const std::string& name) {
  const std::vector<double> values = in.numbers("rotation");
  if (values.size() == 9) return rotation_from_matrix(row_major(values), source, name);
  if (values.size() != 3) in.fail("rotation", "a rotation vector of 3 or a matrix of 9 numbers");
  return quaternion_from_rotation_vector(Eigen::Vector3d::Map(values.data()));
}

std::string camera_name(TableReader& in, const Table& table, bool below_cameras) {
  if (in.has("name")) return in.text_or_number("name");
  if (!below_cameras) return table.key;
  const char* const id = in.has("cam_id") ? "cam_id" : in.has("port") ? "port" : nullptr;
  return "cam_" + (id == nullptr ? table.key : in.text_or_number(id));
}

/// The camera; `posed` tells whether it has a place.
Camera read_camera_table(const Table& table, bool below_cameras, const std::string& source,
                         std::set<std::string>& unused, bool& posed) {
  TableReader in(table, source);
  OpenCvCamera given;
  given.name = camera_name(in, table, below_cameras);
  const std::vector<double> size = in.numbers("size", 2);
  given.width = size[0];
  given.height = size[1];
  given.matrix = row_major(in.numbers("matrix", 9));
  given.distortion = in.numbers("distortions");
  given.fisheye = in.flag("fisheye");
  Camera camera = from_opencv(given, source);
  const bool has_rotation = in.has("rotation"), has_translation = in.has("translation");
  posed = has_rotation && has_translation;
  if (has_rotation != has_translation) {
    in.fail(has_rotation ? "translation" : "rotation", "both rotation and translation, or neither");
  }
  if (posed) {
    camera.camera_from_world.rotation = read_rotation(in, source, given.name);
    camera.camera_from_world.translation_m =
        Eigen::Vector3d::Map(in.numbers("translation", 3).data());
  }
  in.add_unused(unused);
  return camera;
}

/// The end of the text or comment that starts with `opening`.
std::size_t end_of_quoted(std::string_view content, std::size_t start, std::string_view opening) {
  std::size_t i = start + opening.size();
  const bool one_line = opening.size() == 1, escapes = opening[0] == '"';
  while (i < content.size()) {
    if (one_line && content[i] == '\n') return i;
    if (opening != "#" && content.substr(i, opening.size()) == opening) {
      i += opening.size();
      // Up to two quotes may stand before the closing three.
      const std::size_t last = std::min(content.size(), i + (one_line ? 0 : 2));
      while (i < last && content[i] == opening[0]) ++i;
      return i;
    }
    i += escapes && content[i] == '\\' ? 2 : 1;
  }
  return content.size();
}

/// TOML allows letters beyond ASCII in texts and comments only; toml++ 3.3 is undefined on some
/// elsewhere.
void require_ascii_keys(std::string_view content, const std::string& source) {
  constexpr std::string_view byte_order_mark = "\xef\xbb\xbf";
  std::size_t i = content.substr(0, 3) == byte_order_mark ? 3 : 0;
  int line = 1;
  while (i < content.size()) {
    if (static_cast<unsigned char>(content[i]) >= 0x80) {
      throw InvalidInput(
          fmt::format("{}: is not valid TOML at line {}: letters beyond ASCII must "
                      "stand in quotes",
                      source, line));
    }
    std::size_t next = i + 1;
    for (const std::string_view opening : {"\"\"\"", "'''", "\"", "'", "#"}) {
      if (content.substr(i, opening.size()) != opening) continue;
      next = end_of_quoted(content, i, opening);
      break;
    }
    line += static_cast<int>(std::count(
        content.begin() + static_cast<std::ptrdiff_t>(i),
        content.begin() + static_cast<std::ptrdiff_t>(std::min(next, content.size())), '\n'));
    i = next;
  }
}

toml::table parse_table(std::string_view content, const std::string& source) {
  require_ascii_keys(content, source);
  try {
    return toml::parse(content, source);
  } catch (const toml::parse_error& error) {
    throw InvalidInput(fmt::format("{}: is not valid TOML at line {}: {}", source,
                                   error.source().begin.line, error.description()));
  }
}

const toml::table* cameras_table(const toml::table& root) { return root["cameras"].as_table(); }

std::vector<Table> camera_tables(const toml::table& root) {
  std::vector<Table> tables;
  const toml::table* below = cameras_table(root);
  for (const auto& [key, node] : below != nullptr ? *below : root) {
    const toml::table* table = node.as_table();
    const bool is_camera = table != nullptr && (below != nullptr || table->contains("matrix"));
    if (is_camera) tables.push_back({std::string(key.str()), table});
  }
  return tables;
}

bool has_camera_tables(std::string_view content, bool caliscope) {
  try {
    const toml::table root = parse_table(content, "");
    const std::vector<Table> tables = camera_tables(root);
    if (tables.empty()) return false;
    const toml::table& first = *tables.front().content;
    const bool numbered = first.contains("cam_id") || first.contains("port");
    return (cameras_table(root) != nullptr || numbered) == caliscope;
  } catch (const InvalidInput&) {
    return false;
  }
}

bool is_toml(const std::string& path) { return text::lower_extension(path) == ".toml"; }

bool recognises_aniposelib(const std::string& path, std::string_view content) {
  return is_toml(path) && has_camera_tables(content, false);
}
bool recognises_caliscope(const std::string& path, std::string_view content) {
  return is_toml(path) && has_camera_tables(content, true);
}
bool suits_aniposelib(const std::string& path) { return is_toml(path); }
bool suits_caliscope(const std::string& path) {
  return is_toml(path) && path.find("camera_array") != std::string::npos;
}

CameraFile read(const std::string& path) {
  return parse_toml_cameras(text::read_file(path, camera_file_limit_bytes), path);
}

template <class Matrix>
toml::array rows_of(const Matrix& matrix) {
  toml::array rows;
  for (Eigen::Index r = 0; r < matrix.rows(); ++r) {
    toml::array row;
    for (Eigen::Index c = 0; c < matrix.cols(); ++c) row.push_back(double(matrix(r, c)));
    rows.push_back(std::move(row));
  }
  return rows;
}

template <class Values>
toml::array list_of(const Values& values) {
  toml::array list;
  for (const double value : values) list.push_back(value);
  return list;
}

/// What both formats say of a camera. Both programs take 5 coefficients, or 4 of a fisheye lens.
toml::table table_of(const Camera& camera, const std::string& path, std::string_view format) {
  if (camera.lens == Lens::brown8) {
    refuse_lens(path, camera, format, "pinhole, brown2, brown5, fisheye");
  }
  std::vector<double> distortion = opencv_distortion(camera);
  if (camera.lens != Lens::fisheye) distortion.resize(5);
  toml::table table;
  table.insert("size", toml::array{camera.width, camera.height});
  table.insert("matrix", rows_of(opencv_matrix(camera)));
  table.insert("distortions", list_of(distortion));
  if (camera.lens == Lens::fisheye) table.insert("fisheye", true);
  table.insert("translation", list_of(camera.camera_from_world.translation_m));
  return table;
}

void write_toml(const std::string& path, const toml::table& root) {
  std::ostringstream stream;
  stream << root << '\n';
  write_whole(path, stream.str());
}

std::vector<std::string> write_aniposelib(const std::string& path, const CameraFile& file) {
  toml::table root;
  const std::vector<Camera>& cameras = file.rig.cameras;
  // aniposelib sorts the tables by name: the width of the number keeps the order of the cameras.
  const std::size_t width = std::to_string(cameras.size() - 1).size();
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    toml::table table = table_of(cameras[i], path, "aniposelib");
    table.insert("name", cameras[i].name);
    table.insert("rotation",
                 list_of(rotation_vector_from_quaternion(cameras[i].camera_from_world.rotation)));
    root.insert(fmt::format("cam_{:0{}}", i, width), std::move(table));
  }
  root.insert("metadata", toml::table{{"adjusted", false}});
  write_toml(path, root);
  return {};
}

/// N of a name "cam_N", or -1.
int number_in_name(const std::string& name) {
  int number = -1;
  const bool numbered = name.rfind("cam_", 0) == 0 && text::parse(name.substr(4), number);
  return numbered && number >= 0 && name == fmt::format("cam_{}", number) ? number : -1;
}

std::vector<std::string> write_caliscope(const std::string& path, const CameraFile& file) {
  const std::vector<Camera>& cameras = file.rig.cameras;
  const bool numbered = std::all_of(cameras.begin(), cameras.end(), [](const Camera& camera) {
    return number_in_name(camera.name) >= 0;
  });
  std::vector<std::string> notes;
  toml::table tables;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const int id = numbered ? number_in_name(cameras[i].name) : static_cast<int>(i);
    toml::table table = table_of(cameras[i], path, "caliscope");
    table.insert("cam_id", id);
    table.insert("rotation_count", 0);
    table.insert("ignore", false);
    table.insert("rotation", rows_of(cameras[i].camera_from_world.rotation.toRotationMatrix()));
    tables.insert(std::to_string(id), std::move(table));
    if (!numbered) {
      notes.push_back(fmt::format("Caliscope numbers its cameras: {} is now cam_{}",
                                  text::quoted(cameras[i].name), id));
    }
  }
  write_toml(path, toml::table{{"cameras", std::move(tables)}});
  return notes;
}

}  // namespace

CameraFile parse_toml_cameras(std::string_view content, const std::string& source) {
  const toml::table root = parse_table(content, source);
  const std::vector<Table> tables = camera_tables(root);
  if (tables.empty()) {
    throw InvalidInput(source +
                       ": has no camera; expected tables with 'matrix', 'distortions' and "
                       "'size', such as [cam_0] or [cameras.0]");
  }
  if (tables.size() > most_rig_cameras) {
    throw InvalidInput(fmt::format("{}: has more than {} cameras", source, most_rig_cameras));
  }
  CameraFile file;
  std::set<std::string> unused;
  std::vector<std::string> unposed;
  for (const Table& table : tables) {
    bool posed = false;
    file.rig.cameras.push_back(
        read_camera_table(table, cameras_table(root) != nullptr, source, unused, posed));
    if (!posed) unposed.push_back(text::quoted(file.rig.cameras.back().name));
  }
  if (unposed.size() == tables.size()) {
    note_no_poses(file.notes);
  } else if (!unposed.empty()) {
    throw InvalidInput(
        fmt::format("{}: cameras without a pose beside others that have one: {}; "
                    "calibrate them, or take them out of the file",
                    source, fmt::join(unposed, ", ")));
  }
  note_unused(unused, file.notes);
  return file;
}

const CameraFormat aniposelib_format{.name = "aniposelib",
                                     .title = "aniposelib TOML",
                                     .has_unit = false,
                                     .recognises = recognises_aniposelib,
                                     .suits = suits_aniposelib,
                                     .read = read,
                                     .write = write_aniposelib};

const CameraFormat caliscope_format{.name = "caliscope",
                                    .title = "Caliscope TOML",
                                    .recognises = recognises_caliscope,
                                    .suits = suits_caliscope,
                                    .read = read,
                                    .write = write_caliscope};

}  // namespace semblance
