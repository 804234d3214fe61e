#include "semblance/models/load_face.h"

#include <Eigen/QR>
#include <algorithm>
#include <cctype>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>

#include "load_face_parts.h"
#include "semblance/core/errors.h"
#include "semblance/io/json_file.h"
#include "semblance/models/face.h"

namespace semblance {

namespace fs = std::filesystem;

std::string parameter_name(const std::string& shape_name) {
  std::string base = shape_name, side;
  if (base.size() > 2 && base.ends_with("_L")) side = "_left";
  if (base.size() > 2 && base.ends_with("_R")) side = "_right";
  if (!side.empty()) base.resize(base.size() - 2);
  std::string name;
  for (std::size_t i = 0; i < base.size(); ++i) {
    const auto c = static_cast<unsigned char>(base[i]);
    const auto previous = static_cast<unsigned char>(i > 0 ? base[i - 1] : '_');
    const bool starts_word =
        (std::isupper(c) && !std::isupper(previous)) || (std::isdigit(c) && std::isalpha(previous));
    if (starts_word && !name.empty() && name.back() != '_') name += '_';
    if (std::isalnum(c)) {
      name += static_cast<char>(std::tolower(c));
    } else if (!name.empty() && name.back() != '_') {
      name += '_';
    }
  }
  while (!name.empty() && name.back() == '_') name.pop_back();
  return name + side;
}

MorphShape load_face(const std::string& name_or_path, const FaceLoadOptions& options) {
  if (name_or_path == "builtin") return make_sweep_face();
  std::error_code error;
  const fs::path path(name_or_path);
  if (fs::is_directory(path, error)) {
    const bool is_ict = fs::exists(path / "vertex_indices.json", error);
    return is_ict ? load::ict_face(name_or_path, options)
                  : load::obj_folder_face(name_or_path, options);
  }
  if (!fs::exists(path, error)) {
    throw InvalidInput("face model '" + name_or_path +
                       "': no such file or folder; give 'builtin', an ICT FaceKit folder, a folder "
                       "of OBJ files, or a glTF or GLB file");
  }
  if (path.extension() == ".glb" || path.extension() == ".gltf") {
    return load::gltf_face(name_or_path, options);
  }
  throw InvalidInput(name_or_path +
                     ": is not a face model; a folder of OBJ files, or a file named .glb or .gltf, "
                     "was expected");
}

namespace load {

bool is_identity(const std::string& shape_name) { return shape_name.starts_with("identity"); }

namespace {

ParameterBlock identity_block(const std::string& name) {
  return scalar_block(parameter_name(name), "1", -3.0, 3.0, 0.0, 1.0,
                      "identity shape " + name + ", in standard deviations");
}

ParameterBlock expression_block(const std::string& name) {
  return scalar_block(parameter_name(name), "1", 0.0, 1.0, 0.0, 0.3, "expression shape " + name);
}

}  // namespace

void add_shapes(const std::vector<NamedShape>& shapes, const FaceLoadOptions& options,
                const std::string& source, MorphShape& face) {
  std::set<std::string> names;
  for (const bool identity : {true, false}) {
    int count = 0;
    for (const NamedShape& shape : shapes) {
      if (is_identity(shape.name) != identity) continue;
      if (identity && count == options.identity_limit) break;
      const int parameter = static_cast<int>(face.parameters.size());
      const float longest = shape.displacement.rowwise().norm().maxCoeff();
      if (longest < 10.0f * options.threshold_m) continue;
      face.parameters.push_back(identity ? identity_block(shape.name)
                                         : expression_block(shape.name));
      if (!names.insert(face.parameters.back().name).second) {
        throw InvalidInput(source + ": two shapes are called '" + face.parameters.back().name +
                           "' (from '" + shape.name + "'); give each its own name");
      }
      face.fields.push_back(make_field(parameter, shape.displacement, options.threshold_m));
      ++count;
    }
    if (identity) face.identity_count = count;
  }
  if (face.parameters.empty()) {
    throw InvalidInput(source +
                       ": has no shape that moves the face; deltas, one OBJ per shape, or "
                       "morph targets were expected");
  }
}

std::vector<int> read_landmark_vertices(const std::string& path, const std::string& key,
                                        int vertex_count) {
  constexpr std::size_t landmark_count = 68;
  const nlohmann::json file = read_json_file(path);
  if (!file.is_object() || !file.contains(key) || !file[key].is_array() ||
      file[key].size() != landmark_count) {
    throw InvalidInput(path + ": '" + key + "' must be an array of 68 vertex numbers");
  }
  std::vector<int> vertices;
  for (const nlohmann::json& value : file[key]) {
    const bool is_whole = value.is_number_integer() || value.is_number_unsigned();
    const double number = is_whole ? value.get<double>() : -1.0;
    if (number < 0.0 || number >= vertex_count) {
      throw InvalidInput(path + ": '" + key + "' holds " + value.dump() +
                         "; vertex numbers from 0 to " + std::to_string(vertex_count - 1) +
                         " were expected");
    }
    vertices.push_back(value.get<int>());
  }
  return vertices;
}

namespace {

/// Some triangle and corner at each vertex, -1 where none uses it.
std::vector<std::pair<int, int>> triangle_at_vertex(const Mesh& mesh) {
  std::vector<std::pair<int, int>> result(mesh.vertex_count(), {-1, 0});
  for (int t = static_cast<int>(mesh.triangle_count()) - 1; t >= 0; --t) {
    for (int corner = 0; corner < 3; ++corner) result[mesh.triangles(t, corner)] = {t, corner};
  }
  return result;
}

}  // namespace

void set_landmarks(const std::vector<int>& landmark_file_vertices,
                   const std::vector<int>& file_vertex, const std::string& source,
                   MorphShape& face) {
  const auto triangle_at = triangle_at_vertex(*face.mesh);
  for (int wanted : landmark_file_vertices) {
    const auto found = std::find(file_vertex.begin(), file_vertex.end(), wanted);
    const auto place = found == file_vertex.end() ? std::pair<int, int>(-1, 0)
                                                  : triangle_at[found - file_vertex.begin()];
    if (place.first < 0) {
      throw InvalidInput(source + ": landmark vertex " + std::to_string(wanted) +
                         " is in no triangle of the face");
    }
    const std::size_t index = face.landmarks.size();
    ModelLandmark landmark{"landmark_" + std::string(index < 10 ? "0" : "") + std::to_string(index),
                           place.first,
                           {0, 0, 0}};
    landmark.barycentric[place.second] = 1.0f;
    face.landmarks.push_back(std::move(landmark));
  }
}

std::vector<Eigen::Vector3d> landmark_positions(const Mesh& mesh,
                                                const std::vector<ModelLandmark>& landmarks) {
  std::vector<Eigen::Vector3d> positions;
  for (const ModelLandmark& landmark : landmarks) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int corner = 0; corner < 3; ++corner) {
      const int vertex = mesh.triangles(landmark.triangle, corner);
      sum += landmark.barycentric[corner] * mesh.positions_m.row(vertex).transpose();
    }
    positions.push_back(sum);
  }
  return positions;
}

namespace {

/// The unit that brings `length` into the range, else the factor that makes it `usual_m`.
double metres_for(double length, double least_m, double most_m, double usual_m) {
  for (const double unit : {1.0, 0.1, 0.01, 0.001}) {
    if (length * unit >= least_m && length * unit <= most_m) return unit;
  }
  return usual_m / length;
}

Eigen::Vector3d middle_of(const std::vector<Eigen::Vector3d>& points, int first, int last) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int i = first; i < last; ++i) sum += points[i];
  return sum / (last - first);
}

}  // namespace

Normalisation normalisation(const Mesh& mesh, const std::vector<ModelLandmark>& landmarks) {
  Normalisation result;
  if (landmarks.size() == 68) {
    const std::vector<Eigen::Vector3d> points = landmark_positions(mesh, landmarks);
    const Eigen::Vector3d right = middle_of(points, 36, 42), left = middle_of(points, 42, 48);
    result.metre_per_unit = metres_for((left - right).norm(), 0.05, 0.08, 0.063);
    result.origin = 0.5 * (left + right) - Eigen::Vector3d(0, 0, 0.012 / result.metre_per_unit);
    return result;
  }
  const Eigen::RowVector3d lowest = mesh.positions_m.colwise().minCoeff();
  const Eigen::RowVector3d highest = mesh.positions_m.colwise().maxCoeff();
  result.metre_per_unit = metres_for(highest.y() - lowest.y(), 0.12, 0.6, 0.3);
  result.origin = 0.5 * (lowest + highest).transpose();
  return result;
}

MorphShape assemble(const MeshFile& neutral, std::vector<NamedShape> shapes,
                    const std::string& landmark_path, const std::string& source,
                    const FaceLoadOptions& options) {
  MorphShape face;
  auto mesh = std::make_shared<Mesh>(neutral.mesh);
  face.mesh = mesh;
  std::error_code error;
  if (fs::exists(landmark_path, error)) {
    const std::vector<int> vertices =
        read_landmark_vertices(landmark_path, "landmark_vertices", neutral.file_vertex_count);
    set_landmarks(vertices, neutral.file_vertex, landmark_path, face);
  }
  const Normalisation unit = normalisation(*mesh, face.landmarks);
  mesh->positions_m.rowwise() -= unit.origin.transpose();
  mesh->positions_m *= unit.metre_per_unit;
  for (NamedShape& shape : shapes) shape.displacement *= static_cast<float>(unit.metre_per_unit);
  add_shapes(shapes, options, source, face);
  validate(face, source);
  return face;
}

Mesh select_triangles(const Mesh& mesh, const std::vector<bool>& keep,
                      std::vector<int>& old_vertex) {
  std::vector<int> new_vertex(mesh.vertex_count(), -1);
  std::vector<int> kept;
  for (int t = 0; t < mesh.triangle_count(); ++t) {
    if (!keep[t]) continue;
    kept.push_back(t);
    for (int corner = 0; corner < 3; ++corner) new_vertex[mesh.triangles(t, corner)] = 0;
  }
  old_vertex.clear();
  for (int v = 0; v < mesh.vertex_count(); ++v) {
    if (new_vertex[v] < 0) continue;
    new_vertex[v] = static_cast<int>(old_vertex.size());
    old_vertex.push_back(v);
  }
  Mesh result;
  result.positions_m = mesh.positions_m(old_vertex, Eigen::all);
  if (mesh.uvs.rows() > 0) result.uvs = mesh.uvs(old_vertex, Eigen::all);
  result.triangles = mesh.triangles(kept, Eigen::all);
  result.triangles = result.triangles.unaryExpr([&](int v) { return new_vertex[v]; }).eval();
  return result;
}

Eigen::Vector3d sphere_centre(const std::vector<Eigen::Vector3d>& points) {
  // |p|^2 = 2 c'p + (r^2 - |c|^2) is linear in c and the last term.
  const Eigen::Vector3d& origin = points.front();
  Eigen::MatrixXd a(points.size(), 4);
  Eigen::VectorXd b(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d p = points[i] - origin;
    a.row(i) << 2.0 * p.transpose(), 1.0;
    b[i] = p.squaredNorm();
  }
  const Eigen::Vector4d solution = a.colPivHouseholderQr().solve(b);
  return solution.head<3>() + origin;
}

}  // namespace load
}  // namespace semblance
