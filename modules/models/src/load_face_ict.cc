// ICT FaceKit (Li et al. 2020, "Learning Formation of Physically-Based Face Attributes").
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "load_face_parts.h"
#include "semblance/core/errors.h"
#include "semblance/io/json_file.h"

namespace semblance::load {
namespace {

namespace fs = std::filesystem;

constexpr int ict_vertex_count = 26719;
constexpr double metre_per_unit = 0.01;

/// The topology's parts, as the first vertex after each (FaceKit's read-me lists the ranges).
enum class Region {
  face,
  back_head,
  mouth_socket,
  eye_sockets,
  gums_tongue,
  teeth,
  left_eye,
  right_eye,
  films
};

Region region_of(int file_vertex) {
  static const std::pair<int, Region> ends[] = {
      {9409, Region::face},         {11248, Region::back_head},   {13294, Region::mouth_socket},
      {14062, Region::eye_sockets}, {17039, Region::gums_tongue}, {21451, Region::teeth},
      {23021, Region::left_eye},    {24591, Region::right_eye}};
  for (const auto& [end, region] : ends) {
    if (file_vertex < end) return region;
  }
  return Region::films;
}

/// The eyeball's outer shell (with the cornea) is kept and the ball with the iris inside it is not:
/// surfaces are opaque here. For the same reason the films in front of the eye are left out.
bool is_drawn(const std::string& material) {
  static const char* const hidden[] = {"M_IrisLeft", "M_IrisRight",    "M_LacrimalFluid",
                                       "M_EyeBlend", "M_EyeOcclusion", "M_EyeLashes"};
  return std::find(std::begin(hidden), std::end(hidden), material) == std::end(hidden);
}

float float_from_half(std::uint16_t half) {
  const int exponent = half >> 10 & 31;
  const auto mantissa = static_cast<float>(half & 1023);
  const float sign = (half & 0x8000) != 0 ? -1.0f : 1.0f;
  if (exponent == 31) return std::nanf("");  // infinite or not a number
  if (exponent == 0) return sign * std::ldexp(mantissa, -24);
  return sign * std::ldexp(1024.0f + mantissa, exponent - 25);
}

/// Displacements of all file vertices, in the file's unit.
struct FileShape {
  std::string name;
  PointsF displacement;
};

std::vector<std::string> packed_names(const std::string& path) {
  std::ifstream stream(path);
  if (!stream) throw IoError(path + ": cannot be opened");
  std::vector<std::string> names;
  std::string line;
  std::getline(stream, line);  // heading
  while (std::getline(stream, line)) {
    if (!line.empty()) names.push_back(line.substr(0, line.find_first_of(" \t\r")));
  }
  return names;
}

/// ict_deltas_f16.bin: shapes x vertices x 3 little-endian half floats; ict_deltas_names.txt: a
/// heading, then a line per shape that begins with its name.
std::vector<FileShape> packed_shapes(const fs::path& folder) {
  const std::string data_path = (folder / "ict_deltas_f16.bin").string();
  const std::vector<std::string> names = packed_names((folder / "ict_deltas_names.txt").string());
  constexpr std::size_t value_count = std::size_t{ict_vertex_count} * 3;
  std::error_code error;
  const std::uintmax_t size = fs::file_size(data_path, error);
  if (error || size != names.size() * value_count * 2) {
    throw InvalidInput(fmt::format("{}: {} bytes; {} shapes of {} vertices take {}", data_path,
                                   error ? 0 : size, names.size(), ict_vertex_count,
                                   names.size() * value_count * 2));
  }
  std::ifstream stream(data_path, std::ios::binary);
  std::vector<unsigned char> bytes(value_count * 2);
  std::vector<FileShape> shapes;
  for (const std::string& name : names) {
    if (!stream.read(reinterpret_cast<char*>(bytes.data()),
                     static_cast<std::streamsize>(bytes.size()))) {
      throw IoError(data_path + ": reading failed");
    }
    FileShape shape{name, PointsF(ict_vertex_count, 3)};
    for (std::size_t i = 0; i < value_count; ++i) {
      const int half = bytes[2 * i] | bytes[2 * i + 1] << 8;
      shape.displacement.data()[i] = float_from_half(static_cast<std::uint16_t>(half));
    }
    if (!shape.displacement.allFinite()) {
      throw InvalidInput(
          fmt::format("{}: shape '{}' holds a value that is not finite", data_path, name));
    }
    shapes.push_back(std::move(shape));
  }
  return shapes;
}

/// Positions per file vertex; vertices that no face uses stay at the origin.
PointsF per_file_vertex(const MeshFile& file) {
  PointsF positions = PointsF::Zero(file.file_vertex_count, 3);
  for (std::size_t i = 0; i < file.file_vertex.size(); ++i) {
    positions.row(file.file_vertex[i]) = file.mesh.positions_m.row(i).cast<float>();
  }
  return positions;
}

/// FaceKit as published: one OBJ per shape beside the neutral.
std::vector<FileShape> separate_shapes(const fs::path& folder, const MeshFile& neutral) {
  std::vector<std::string> files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() != ".obj" || entry.path().stem() == "generic_neutral_mesh")
      continue;
    files.push_back(entry.path().string());
  }
  std::sort(files.begin(), files.end());
  const PointsF origin = per_file_vertex(neutral);
  std::vector<FileShape> shapes;
  for (const std::string& path : files) {
    const MeshFile file = read_obj(path);
    if (file.file_vertex_count != ict_vertex_count) {
      throw InvalidInput(fmt::format("{}: has {} vertices; a FaceKit shape has {}", path,
                                     file.file_vertex_count, ict_vertex_count));
    }
    shapes.push_back({fs::path(path).stem().string(), per_file_vertex(file) - origin});
  }
  return shapes;
}

struct Eye {
  Eigen::Vector3d centre_m, axis;
  double radius_m = 0.0;
};

/// The ball from the rear half of the shell, its axis through the cornea's foremost point.
Eye find_eye(const Mesh& mesh, const std::vector<int>& file_vertex, Region side,
             const std::string& source) {
  std::vector<Eigen::Vector3d> all, rear;
  for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v) {
    if (region_of(file_vertex[v]) == side) all.push_back(mesh.positions_m.row(v));
  }
  if (all.size() < 100) throw InvalidInput(source + ": an eyeball is missing");
  double middle_z = 0.0;
  for (const Eigen::Vector3d& p : all) middle_z += p.z() / static_cast<double>(all.size());
  std::copy_if(all.begin(), all.end(), std::back_inserter(rear),
               [&](const Eigen::Vector3d& p) { return p.z() < middle_z; });
  Eye eye;
  eye.centre_m = sphere_centre(rear);
  for (const Eigen::Vector3d& p : rear) {
    eye.radius_m += (p - eye.centre_m).norm() / static_cast<double>(rear.size());
  }
  const auto apex = std::max_element(all.begin(), all.end(), [&](const auto& a, const auto& b) {
    return (a - eye.centre_m).squaredNorm() < (b - eye.centre_m).squaredNorm();
  });
  eye.axis = (*apex - eye.centre_m).normalized();
  return eye;
}

FacePart eye_part(const Eye& eye, const Eigen::Vector3d& position_m) {
  // Half-angles at the ball's centre under which FacKit's own iris and pupil appear.
  constexpr double iris_rad = 0.42, pupil_rad = 0.16;
  const double cosine = (position_m - eye.centre_m).normalized().dot(eye.axis);
  if (cosine > std::cos(pupil_rad)) return FacePart::pupil;
  return cosine > std::cos(iris_rad) ? FacePart::iris : FacePart::sclera;
}

using Point2 = Eigen::Vector2d;

bool inside_polygon(const std::vector<Point2>& polygon, const Point2& p) {
  bool inside = false;
  for (std::size_t i = 0, j = polygon.size() - 1; i < polygon.size(); j = i++) {
    const Point2 &a = polygon[i], &b = polygon[j];
    if ((a.y() > p.y()) == (b.y() > p.y())) continue;
    if (p.x() < a.x() + (p.y() - a.y()) / (b.y() - a.y()) * (b.x() - a.x())) inside = !inside;
  }
  return inside;
}

double distance_to_polyline(const std::vector<Eigen::Vector3d>& line, const Eigen::Vector3d& p) {
  double least = 1e9;
  for (std::size_t i = 1; i < line.size(); ++i) {
    const Eigen::Vector3d side = line[i] - line[i - 1];
    const double t = std::clamp((p - line[i - 1]).dot(side) / side.squaredNorm(), 0.0, 1.0);
    least = std::min(least, (p - line[i - 1] - t * side).norm());
  }
  return least;
}

/// Parts of the skin by the landmarks in front view; the scan has no brows or hair of its own.
class SkinParts {
 public:
  explicit SkinParts(std::vector<Eigen::Vector3d> landmarks_m) : points_(std::move(landmarks_m)) {
    for (int i = 48; i < 60; ++i) lips_.push_back(points_[i].head<2>());
    right_brow_.assign(points_.begin() + 17, points_.begin() + 22);
    left_brow_.assign(points_.begin() + 22, points_.begin() + 27);
  }

  FacePart of(Region region, const Eigen::Vector3d& p) const {
    constexpr double brow_half_width_m = 0.004, lip_depth_m = 0.015;
    const double temple_y = points_[0].y(), temple_x = points_[16].x();
    if (region == Region::back_head) return p.y() > temple_y ? FacePart::hair : FacePart::neck;
    if (p.z() > points_[48].z() - lip_depth_m && inside_polygon(lips_, p.head<2>())) {
      return FacePart::lips;
    }
    if (std::min(distance_to_polyline(right_brow_, p), distance_to_polyline(left_brow_, p)) <
        brow_half_width_m) {
      return FacePart::brow;
    }
    if (std::abs(p.x()) > temple_x && p.z() < points_[0].z()) return FacePart::ear;
    const bool below_chin = p.y() < points_[8].y() && p.z() < points_[8].z() - 0.02;
    return below_chin ? FacePart::neck : FacePart::skin;
  }

 private:
  std::vector<Eigen::Vector3d> points_, right_brow_, left_brow_;
  std::vector<Point2> lips_;
};

FacePart gum_part(const Eigen::Vector3d& p, const std::vector<Eigen::Vector3d>& landmarks_m) {
  // The tongue lies between the rows of teeth, behind them.
  const double mouth_y = landmarks_m[66].y();
  const bool in_the_middle = std::abs(p.x()) < 0.02 && std::abs(p.y() - mouth_y + 0.01) < 0.012;
  return in_the_middle && p.z() < landmarks_m[66].z() - 0.01 ? FacePart::tongue
                                                             : FacePart::mouth_cavity;
}

MeshFile read_ict_mesh(const std::string& path) {
  MeshFile file = read_obj(path);
  if (file.file_vertex_count != ict_vertex_count) {
    throw InvalidInput(fmt::format("{}: has {} vertices; the FaceKit mesh has {}", path,
                                   file.file_vertex_count, ict_vertex_count));
  }
  return file;
}

/// The opaque surfaces in metres; `file_vertex` becomes the file's number of each vertex left.
Mesh drawn_mesh(const MeshFile& file, std::vector<int>& file_vertex) {
  std::vector<bool> drawn(file.triangle_material.size());
  for (std::size_t t = 0; t < drawn.size(); ++t) {
    const int material = file.triangle_material[t];
    drawn[t] = material < 0 || is_drawn(file.materials[material]);
  }
  Mesh mesh = select_triangles(file.mesh, drawn, file_vertex);
  for (int& vertex : file_vertex) vertex = file.file_vertex[vertex];
  mesh.positions_m *= metre_per_unit;
  return mesh;
}

std::vector<std::uint8_t> parts_of(const Mesh& mesh, const std::vector<int>& file_vertex,
                                   const std::vector<Eigen::Vector3d>& landmarks_m, const Eye& left,
                                   const Eye& right) {
  const SkinParts skin(landmarks_m);
  const auto part_of = [&](int vertex, const Eigen::Vector3d& p) {
    switch (const Region region = region_of(vertex)) {
      case Region::face:
      case Region::back_head:
        return skin.of(region, p);
      case Region::mouth_socket:
        return FacePart::mouth_cavity;
      case Region::gums_tongue:
        return gum_part(p, landmarks_m);
      case Region::teeth:
        return FacePart::teeth;
      case Region::left_eye:
        return eye_part(left, p);
      case Region::right_eye:
        return eye_part(right, p);
      case Region::eye_sockets:
      case Region::films:
        break;
    }
    return FacePart::other;
  };
  std::vector<std::uint8_t> parts(file_vertex.size());
  for (std::size_t v = 0; v < parts.size(); ++v) {
    parts[v] = static_cast<std::uint8_t>(part_of(file_vertex[v], mesh.positions_m.row(v)));
  }
  return parts;
}

std::vector<NamedShape> ict_shapes(const std::string& folder, const MeshFile& file,
                                   const std::vector<int>& file_vertex) {
  std::error_code error;
  const bool is_packed = fs::exists(fs::path(folder) / "ict_deltas_f16.bin", error);
  std::vector<FileShape> file_shapes =
      is_packed ? packed_shapes(folder) : separate_shapes(folder, file);
  std::vector<NamedShape> shapes;
  for (FileShape& shape : file_shapes) {
    shapes.push_back({shape.name, static_cast<float>(metre_per_unit) *
                                      shape.displacement(file_vertex, Eigen::all)});
    shape.displacement.resize(0, 3);
  }
  return shapes;
}

}  // namespace

MorphShape ict_face(const std::string& folder, const FaceLoadOptions& options) {
  const std::string mesh_path = (fs::path(folder) / "generic_neutral_mesh.obj").string();
  const MeshFile file = read_ict_mesh(mesh_path);
  std::vector<int> file_vertex;
  auto mesh = std::make_shared<Mesh>(drawn_mesh(file, file_vertex));
  Eye left = find_eye(*mesh, file_vertex, Region::left_eye, mesh_path);
  Eye right = find_eye(*mesh, file_vertex, Region::right_eye, mesh_path);
  const Eigen::Vector3d origin = 0.5 * (left.centre_m + right.centre_m);
  mesh->positions_m.rowwise() -= origin.transpose();
  left.centre_m -= origin;
  right.centre_m -= origin;

  MorphShape face;
  face.mesh = mesh;
  const std::string index_path = (fs::path(folder) / "vertex_indices.json").string();
  const std::vector<int> landmark_vertices =
      read_landmark_vertices(index_path, "idx_to_landmark_verts", ict_vertex_count);
  set_landmarks(landmark_vertices, file_vertex, index_path, face);
  face.part = parts_of(*mesh, file_vertex, landmark_positions(*mesh, face.landmarks), left, right);
  add_shapes(ict_shapes(folder, file, file_vertex), options, folder, face);
  validate(face, folder);
  return face;
}

}  // namespace semblance::load
