#include <fmt/format.h>

#include <algorithm>

#include "parsers.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/io/mesh_io.h"
#include "semblance/io/text.h"

namespace semblance {
namespace {

/// A face's corner as the file gives it: indices from 0, -1 for no texture coordinate.
struct Corner {
  int vertex = 0, uv = -1;
};

class ObjParser {
 public:
  ObjParser(std::string source, std::string_view content) : source_(std::move(source)) {
    text::Lines lines(content);
    for (std::string_view line; lines.next(line);) {
      line_ = lines.number();
      parse_line(line.substr(0, line.find('#')));
    }
    if (positions_.empty() || corners_.empty()) {
      throw InvalidInput(source_ + ": has no " + (positions_.empty() ? "vertices" : "faces") +
                         "; a Wavefront OBJ file with lines 'v x y z' and 'f a b c' was expected");
    }
  }

  MeshFile finish();

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw InvalidInput(fmt::format("{}:{}: {}", source_, line_, what));
  }
  void parse_line(std::string_view line);
  void parse_face(std::string_view line);
  void parse_material(std::string_view line);
  Corner parse_corner(std::string_view word) const;
  int parse_index(std::string_view word, std::size_t count, const char* what) const;
  template <int N>
  Eigen::Matrix<double, N, 1> parse_vector(std::string_view line, const char* form) const;
  void number_vertices(MeshFile& file);

  std::string source_;
  int line_ = 0;
  std::vector<Eigen::Vector3d> positions_;
  std::vector<Eigen::Vector2d> uvs_;
  std::vector<Corner> corners_;  // three per triangle
  bool every_corner_has_uv_ = true;
  std::vector<std::string> materials_;
  std::vector<int> triangle_material_;
  int material_ = -1;
  std::vector<Corner> polygon_;
};

void ObjParser::parse_line(std::string_view line) {
  const std::string_view keyword = text::next_word(line);
  if (keyword == "v") {
    positions_.push_back(parse_vector<3>(line, "v x y z"));
  } else if (keyword == "vt") {
    uvs_.push_back(parse_vector<2>(line, "vt u v"));
  } else if (keyword == "f") {
    parse_face(line);
  } else if (keyword == "usemtl") {
    parse_material(line);
  }
}

template <int N>
Eigen::Matrix<double, N, 1> ObjParser::parse_vector(std::string_view line, const char* form) const {
  Eigen::Matrix<double, N, 1> vector;
  for (int i = 0; i < N; ++i) {
    const std::string_view word = text::next_word(line);
    if (!text::parse(word, vector[i])) {
      fail(fmt::format("{} is not a finite number; '{}' was expected", text::quoted(word), form));
    }
  }
  return vector;
}

void ObjParser::parse_material(std::string_view line) {
  const std::string name(text::next_word(line));
  const auto known = std::find(materials_.begin(), materials_.end(), name);
  material_ = static_cast<int>(known - materials_.begin());
  if (known != materials_.end()) return;
  constexpr std::size_t most_materials = 4096;
  if (materials_.size() == most_materials) fail("more than 4096 materials");
  materials_.push_back(name);
}

int ObjParser::parse_index(std::string_view word, std::size_t count, const char* what) const {
  int index = 0;
  if (!text::parse(word, index)) {
    fail(fmt::format("{} is not an index; 'f a b c' or 'f a/ta b/tb c/tc' was expected",
                     text::quoted(word)));
  }
  const std::int64_t absolute = index < 0 ? static_cast<std::int64_t>(count) + index : index - 1LL;
  if (index == 0 || absolute < 0 || absolute >= static_cast<std::int64_t>(count)) {
    fail(fmt::format("{} {} does not exist; {} are defined above this line", what, index, count));
  }
  return static_cast<int>(absolute);
}

Corner ObjParser::parse_corner(std::string_view word) const {
  const std::size_t slash = word.find('/');
  Corner corner;
  corner.vertex = parse_index(word.substr(0, slash), positions_.size(), "vertex");
  if (slash == std::string_view::npos) return corner;
  const std::string_view rest = word.substr(slash + 1);
  const std::string_view uv = rest.substr(0, rest.find('/'));
  if (!uv.empty()) corner.uv = parse_index(uv, uvs_.size(), "texture coordinate");
  return corner;
}

void ObjParser::parse_face(std::string_view line) {
  polygon_.clear();
  for (std::string_view word = text::next_word(line); !word.empty(); word = text::next_word(line)) {
    polygon_.push_back(parse_corner(word));
    every_corner_has_uv_ &= polygon_.back().uv >= 0;
  }
  if (polygon_.size() < 3) fail("a face needs three corners or more");
  for (std::size_t i = 2; i < polygon_.size(); ++i) {
    const Corner a = polygon_[0], b = polygon_[i - 1], c = polygon_[i];
    // Some programs write a triangle as a quad with a corner twice: that half has no area.
    if (a.vertex == b.vertex || b.vertex == c.vertex || c.vertex == a.vertex) continue;
    corners_.insert(corners_.end(), {a, b, c});
    triangle_material_.push_back(material_);
  }
}

/// Gives each (vertex, uv) pair in use a vertex of the mesh, in the order of the file's vertices.
void ObjParser::number_vertices(MeshFile& file) {
  if (!every_corner_has_uv_) {
    for (Corner& corner : corners_) corner.uv = -1;
  }
  const auto key = [](const Corner& corner) {
    return static_cast<std::int64_t>(corner.vertex) << 32 | static_cast<std::uint32_t>(corner.uv);
  };
  std::vector<std::int64_t> keys(corners_.size());
  std::transform(corners_.begin(), corners_.end(), keys.begin(), key);
  std::sort(keys.begin(), keys.end());
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());

  const auto count = static_cast<Eigen::Index>(keys.size());
  file.file_vertex.resize(keys.size());
  file.mesh.positions_m.resize(count, 3);
  if (every_corner_has_uv_) file.mesh.uvs.resize(count, 2);
  for (Eigen::Index i = 0; i < count; ++i) {
    file.file_vertex[i] = static_cast<int>(keys[i] >> 32);
    file.mesh.positions_m.row(i) = positions_[file.file_vertex[i]];
    if (every_corner_has_uv_) {
      file.mesh.uvs.row(i) = uvs_[static_cast<std::uint32_t>(keys[i])].cast<float>();
    }
  }
  file.mesh.triangles.resize(static_cast<Eigen::Index>(corners_.size() / 3), 3);
  for (std::size_t i = 0; i < corners_.size(); ++i) {
    const auto found = std::lower_bound(keys.begin(), keys.end(), key(corners_[i]));
    file.mesh.triangles(static_cast<Eigen::Index>(i / 3), static_cast<Eigen::Index>(i % 3)) =
        static_cast<int>(found - keys.begin());
  }
}

MeshFile ObjParser::finish() {
  MeshFile file;
  number_vertices(file);
  file.file_vertex_count = static_cast<int>(positions_.size());
  file.materials = std::move(materials_);
  file.triangle_material = std::move(triangle_material_);
  validate(file.mesh, source_);
  return file;
}

}  // namespace

MeshFile parse_obj(std::string_view content, const std::string& source) {
  return ObjParser(source, content).finish();
}

MeshFile read_obj(const std::string& path) { return parse_obj(text::read_file(path), path); }

void write_obj(const std::string& path, const Mesh& mesh) {
  validate(mesh, path);
  AtomicFile file(path);
  fmt::memory_buffer out;
  const auto end = std::back_inserter(out);
  for (Eigen::Index i = 0; i < mesh.vertex_count(); ++i) {
    const auto p = mesh.positions_m.row(i);
    fmt::format_to(end, "v {} {} {}\n", p[0], p[1], p[2]);
  }
  for (Eigen::Index i = 0; i < mesh.uvs.rows(); ++i) {
    fmt::format_to(end, "vt {} {}\n", mesh.uvs(i, 0), mesh.uvs(i, 1));
  }
  const bool has_uvs = mesh.uvs.rows() > 0;
  for (Eigen::Index i = 0; i < mesh.triangle_count(); ++i) {
    const auto t = mesh.triangles.row(i).array() + 1;
    if (has_uvs) {
      fmt::format_to(end, "f {0}/{0} {1}/{1} {2}/{2}\n", t[0], t[1], t[2]);
    } else {
      fmt::format_to(end, "f {} {} {}\n", t[0], t[1], t[2]);
    }
  }
  file.stream().write(out.data(), static_cast<std::streamsize>(out.size()));
  file.commit();
}

}  // namespace semblance
