// Mesh files.
#pragma once

#include <string>
#include <vector>

#include "semblance/core/mesh.h"

namespace semblance {

/// A mesh as a file has it, with what is needed to attach data given per vertex of the file.
/// Polygons are fanned into triangles (halves without area left out), vertices are in the file's
/// order, doubled along uv seams, and left out where no face uses them. There are uvs only if every
/// face has them.
struct MeshFile {
  Mesh mesh;
  std::vector<int> file_vertex;  // for each vertex of `mesh`, its index in the file
  int file_vertex_count = 0;
  std::vector<std::string> materials;  // names in order of first use, possibly empty
  std::vector<int> triangle_material;  // per triangle, index into `materials` or -1
};

/// Wavefront OBJ. Units are the file's own. Throws InvalidInput naming file and line.
MeshFile read_obj(const std::string& path);
void write_obj(const std::string& path, const Mesh& mesh);
/// Stanford PLY, ASCII or little-endian binary.
Mesh read_ply(const std::string& path);
void write_ply(const std::string& path, const Mesh& mesh);

/// By the extension, .obj or .ply in any case; InvalidInput for others.
Mesh read_mesh(const std::string& path);
void write_mesh(const std::string& path, const Mesh& mesh);

}  // namespace semblance
