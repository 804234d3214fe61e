// Stanford PLY (Turk 1994).
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>

#include "parsers.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/io/mesh_io.h"
#include "semblance/io/text.h"

namespace semblance {
namespace {

static_assert(std::endian::native == std::endian::little);

enum class Type { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

std::size_t size_of(Type type) {
  constexpr std::size_t sizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
  return sizes[static_cast<int>(type)];
}

bool parse_type(std::string_view word, Type& type) {
  static constexpr std::pair<std::string_view, Type> names[] = {
      {"char", Type::int8},      {"int8", Type::int8},       {"uchar", Type::uint8},
      {"uint8", Type::uint8},    {"short", Type::int16},     {"int16", Type::int16},
      {"ushort", Type::uint16},  {"uint16", Type::uint16},   {"int", Type::int32},
      {"int32", Type::int32},    {"uint", Type::uint32},     {"uint32", Type::uint32},
      {"float", Type::float32},  {"float32", Type::float32}, {"double", Type::float64},
      {"float64", Type::float64}};
  for (const auto& [name, value] : names) {
    if (word != name) continue;
    type = value;
    return true;
  }
  return false;
}

struct Property {
  std::string name;
  Type type = Type::float32;
  bool is_list = false;
  Type count_type = Type::uint8;
};

struct Element {
  std::string name;
  std::size_t count = 0;
  std::vector<Property> properties;
};

/// What of a vertex is kept: x, y, z, u, v.
enum Slot { slot_x, slot_y, slot_z, slot_u, slot_v, slot_count, slot_none = -1 };

Slot vertex_slot(const std::string& name) {
  static const std::pair<const char*, Slot> names[] = {
      {"x", slot_x}, {"y", slot_y}, {"z", slot_z},         {"u", slot_u},        {"v", slot_v},
      {"s", slot_u}, {"t", slot_v}, {"texture_u", slot_u}, {"texture_v", slot_v}};
  for (const auto& [known, slot] : names) {
    if (name == known) return slot;
  }
  return slot_none;
}

class PlyParser {
 public:
  PlyParser(std::string source, std::string_view content)
      : source_(std::move(source)), rest_(content) {
    read_header();
    for (const Element& element : elements_) {
      for (row_ = 0; row_ < element.count; ++row_) read_row(element);
    }
  }

  Mesh finish();

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw InvalidInput(fmt::format("{}: {}", source_, what));
  }
  std::string_view next_line();
  void read_header();
  void read_header_line(std::string_view line);
  void read_format(std::string_view line);
  void read_property(std::string_view line);
  void check_header() const;
  void read_row(const Element& element);
  double read_value(const Element& element, const Property& property, Type type);
  double read_binary(Type type);
  void keep_face(const std::vector<double>& polygon);

  std::string source_;
  std::string_view rest_;
  bool binary_ = false, format_known_ = false;
  std::vector<Element> elements_;
  std::size_t row_ = 0;
  std::string_view ascii_row_;
  bool has_uv_ = false;
  std::vector<std::array<double, slot_count>> vertices_;
  std::vector<int> corners_;
  std::vector<double> list_;
};

std::string_view PlyParser::next_line() {
  if (rest_.empty()) fail("the file ends too early; copy it again");
  const std::size_t end = rest_.find('\n');
  std::string_view line = rest_.substr(0, end);
  rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + 1);
  if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
  return line;
}

void PlyParser::read_header() {
  if (next_line() != "ply") fail("is not a PLY file: the first line must be 'ply'");
  for (std::string_view line = next_line(); line != "end_header"; line = next_line()) {
    read_header_line(line);
  }
  check_header();
}

void PlyParser::read_header_line(std::string_view line) {
  const std::string_view whole = line;
  const std::string_view keyword = text::next_word(line);
  if (keyword == "format") {
    read_format(line);
  } else if (keyword == "element") {
    Element element;
    element.name = text::next_word(line);
    int count = 0;
    if (!text::parse(text::next_word(line), count) || count < 0) {
      fail(fmt::format("header line {}: 'element NAME COUNT' was expected", text::quoted(whole)));
    }
    element.count = static_cast<std::size_t>(count);
    elements_.push_back(std::move(element));
  } else if (keyword == "property" && !elements_.empty()) {
    read_property(line);
  } else if (keyword != "comment" && keyword != "obj_info") {
    fail(fmt::format("header line {} is not known", text::quoted(whole)));
  }
}

void PlyParser::read_format(std::string_view line) {
  const std::string_view format = text::next_word(line);
  if (format != "ascii" && format != "binary_little_endian") {
    fail(fmt::format("format {} cannot be read; ascii or binary_little_endian was expected",
                     text::quoted(format)));
  }
  binary_ = format != "ascii";
  format_known_ = true;
}

void PlyParser::read_property(std::string_view line) {
  const std::string_view whole = line;
  Property property;
  std::string_view type = text::next_word(line);
  property.is_list = type == "list";
  bool known = true;
  if (property.is_list) {
    known = parse_type(text::next_word(line), property.count_type);
    known &= property.count_type != Type::float32 && property.count_type != Type::float64;
    type = text::next_word(line);
  }
  known &= parse_type(type, property.type);
  property.name = text::next_word(line);
  if (!known || property.name.empty()) {
    fail(fmt::format("header: property {} has no known type and name", text::quoted(whole)));
  }
  elements_.back().properties.push_back(std::move(property));
}

void PlyParser::check_header() const {
  if (!format_known_) fail("header: the line 'format' is missing");
  bool faces = false, seen[slot_count] = {};
  for (const Element& element : elements_) {
    // A row takes a byte or more (the file's end included), so a damaged count is caught here.
    if (element.properties.empty() || element.count > rest_.size() + 1) {
      fail(
          fmt::format("header: element '{}' has {} rows, more than the file can hold, or no "
                      "properties",
                      element.name, element.count));
    }
    for (const Property& property : element.properties) {
      const bool is_vertex = element.name == "vertex" && !property.is_list;
      const Slot slot = is_vertex ? vertex_slot(property.name) : slot_none;
      if (slot != slot_none) seen[slot] = true;
      faces |= element.name == "face" && property.is_list &&
               (property.name == "vertex_indices" || property.name == "vertex_index");
    }
  }
  if (!seen[slot_x] || !seen[slot_y] || !seen[slot_z] || !faces) {
    fail("header: vertices with x, y, z and faces with a list 'vertex_indices' were expected");
  }
}

double PlyParser::read_binary(Type type) {
  const std::size_t size = size_of(type);
  if (rest_.size() < size) fail("the file ends too early; copy it again");
  const char* data = rest_.data();
  rest_.remove_prefix(size);
  const auto load = [data]<typename T>(T value) {
    std::memcpy(&value, data, sizeof(T));
    return static_cast<double>(value);
  };
  switch (type) {
    case Type::int8:
      return load(std::int8_t{});
    case Type::uint8:
      return load(std::uint8_t{});
    case Type::int16:
      return load(std::int16_t{});
    case Type::uint16:
      return load(std::uint16_t{});
    case Type::int32:
      return load(std::int32_t{});
    case Type::uint32:
      return load(std::uint32_t{});
    case Type::float32:
      return load(float{});
    case Type::float64:
      break;
  }
  return load(double{});
}

double PlyParser::read_value(const Element& element, const Property& property, Type type) {
  double value = 0.0;
  bool usable = true;
  if (binary_) {
    value = read_binary(type);
    usable = std::isfinite(value);
  } else {
    usable = text::parse(text::next_word(ascii_row_), value);
  }
  if (!usable) {
    fail(fmt::format("{} {} (from 0): property '{}' is missing or not a finite number",
                     element.name, row_, property.name));
  }
  return value;
}

void PlyParser::read_row(const Element& element) {
  if (!binary_) ascii_row_ = next_line();
  const bool is_vertex = element.name == "vertex", is_face = element.name == "face";
  std::array<double, slot_count> vertex{};
  for (const Property& property : element.properties) {
    if (!property.is_list) {
      const double value = read_value(element, property, property.type);
      const Slot slot = is_vertex ? vertex_slot(property.name) : slot_none;
      if (slot != slot_none) vertex[slot] = value;
      has_uv_ |= slot == slot_u;
      continue;
    }
    const double count = read_value(element, property, property.count_type);
    if (count < 0.0 || count != std::floor(count) ||
        count > static_cast<double>(rest_.size() + ascii_row_.size())) {
      fail(fmt::format("{} {} (from 0): the list '{}' has length {}", element.name, row_,
                       property.name, count));
    }
    list_.clear();
    for (double i = 0; i < count; ++i)
      list_.push_back(read_value(element, property, property.type));
    if (is_face && property.name.starts_with("vertex_ind")) keep_face(list_);
  }
  if (is_vertex) vertices_.push_back(vertex);
}

void PlyParser::keep_face(const std::vector<double>& polygon) {
  if (polygon.size() < 3) fail(fmt::format("face {} (from 0) has fewer than three corners", row_));
  for (double index : polygon) {
    // Vertices may follow the faces, so only the range of numbers is checked here.
    if (index < 0.0 || index > 2147483647.0 || index != std::floor(index)) {
      fail(fmt::format("face {} (from 0): {} is not a vertex number", row_, index));
    }
  }
  for (std::size_t i = 2; i < polygon.size(); ++i) {
    const int a = static_cast<int>(polygon[0]), b = static_cast<int>(polygon[i - 1]),
              c = static_cast<int>(polygon[i]);
    if (a != b && b != c && c != a) corners_.insert(corners_.end(), {a, b, c});
  }
}

Mesh PlyParser::finish() {
  Mesh mesh;
  mesh.positions_m.resize(static_cast<Eigen::Index>(vertices_.size()), 3);
  if (has_uv_) mesh.uvs.resize(static_cast<Eigen::Index>(vertices_.size()), 2);
  for (std::size_t i = 0; i < vertices_.size(); ++i) {
    const auto& v = vertices_[i];
    mesh.positions_m.row(i) << v[slot_x], v[slot_y], v[slot_z];
    if (has_uv_) mesh.uvs.row(i) << static_cast<float>(v[slot_u]), static_cast<float>(v[slot_v]);
  }
  mesh.triangles.resize(static_cast<Eigen::Index>(corners_.size() / 3), 3);
  std::copy(corners_.begin(), corners_.end(), mesh.triangles.data());
  validate(mesh, source_);
  return mesh;
}

template <typename T>
void append(std::string& out, T value) {
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof(T));
  out.append(bytes, sizeof(T));
}

}  // namespace

Mesh parse_ply(std::string_view content, const std::string& source) {
  return PlyParser(source, content).finish();
}

Mesh read_ply(const std::string& path) { return parse_ply(text::read_file(path), path); }

void write_ply(const std::string& path, const Mesh& mesh) {
  validate(mesh, path);
  const bool has_uvs = mesh.uvs.rows() > 0;
  std::string out = fmt::format(
      "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty double x\n"
      "property double y\nproperty double z\n{}element face {}\n"
      "property list uchar int vertex_indices\nend_header\n",
      mesh.vertex_count(), has_uvs ? "property float s\nproperty float t\n" : "",
      mesh.triangle_count());
  for (Eigen::Index i = 0; i < mesh.vertex_count(); ++i) {
    for (int axis = 0; axis < 3; ++axis) append(out, mesh.positions_m(i, axis));
    for (int axis = 0; has_uvs && axis < 2; ++axis) append(out, mesh.uvs(i, axis));
  }
  for (Eigen::Index i = 0; i < mesh.triangle_count(); ++i) {
    append(out, std::uint8_t{3});
    for (int corner = 0; corner < 3; ++corner) {
      append(out, static_cast<std::int32_t>(mesh.triangles(i, corner)));
    }
  }
  AtomicFile file(path);
  file.stream().write(out.data(), static_cast<std::streamsize>(out.size()));
  file.commit();
}

}  // namespace semblance
