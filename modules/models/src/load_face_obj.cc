// A folder of OBJ files: the neutral face, and one file per shape with the same vertices.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "load_face_parts.h"
#include "semblance/core/errors.h"

namespace semblance::load {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> obj_files(const std::string& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() == ".obj") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

/// Takes the one file with "neutral" in its name out of the list.
fs::path take_neutral(std::vector<fs::path>& files, const std::string& folder) {
  const auto is_neutral = [](const fs::path& path) {
    return path.stem().string().find("neutral") != std::string::npos;
  };
  if (std::count_if(files.begin(), files.end(), is_neutral) != 1) {
    throw InvalidInput(folder +
                       ": a face model's folder needs exactly one OBJ file with 'neutral' "
                       "in its name, and one more OBJ file per shape");
  }
  const auto found = std::find_if(files.begin(), files.end(), is_neutral);
  fs::path neutral = *found;
  files.erase(found);
  return neutral;
}

NamedShape read_shape(const fs::path& path, const MeshFile& neutral) {
  const MeshFile file = read_obj(path.string());
  // Faces and texture must be those of the neutral too, or the doubled vertices would not match.
  if (file.file_vertex_count != neutral.file_vertex_count ||
      file.file_vertex != neutral.file_vertex) {
    throw InvalidInput(
        fmt::format("{}: its vertices and faces ({} and {}) are not those of the "
                    "neutral face ({} and {}); export all shapes from one mesh",
                    path.string(), file.file_vertex_count, file.mesh.triangle_count(),
                    neutral.file_vertex_count, neutral.mesh.triangle_count()));
  }
  return {path.stem().string(), (file.mesh.positions_m - neutral.mesh.positions_m).cast<float>()};
}

}  // namespace

MorphShape obj_folder_face(const std::string& folder, const FaceLoadOptions& options) {
  std::vector<fs::path> files = obj_files(folder);
  const fs::path neutral_path = take_neutral(files, folder);
  const MeshFile neutral = read_obj(neutral_path.string());
  std::vector<NamedShape> shapes;
  for (const fs::path& path : files) shapes.push_back(read_shape(path, neutral));
  const fs::path landmarks = fs::path(folder) / "landmarks.json";
  return assemble(neutral, std::move(shapes), landmarks.string(), folder, options);
}

}  // namespace semblance::load
