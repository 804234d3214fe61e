// What the readers of face models share.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "semblance/io/mesh_io.h"
#include "semblance/models/load_face.h"

namespace semblance::load {

MorphShape ict_face(const std::string& folder, const FaceLoadOptions& options);
MorphShape obj_folder_face(const std::string& folder, const FaceLoadOptions& options);
MorphShape gltf_face(const std::string& path, const FaceLoadOptions& options);
/// The same for the content of a file; `source` names it, and lies where further files would.
MorphShape gltf_face_from_bytes(std::string_view content, const std::string& source,
                                const FaceLoadOptions& options);

/// A shape as a file names it, and how every vertex of the mesh moves at weight 1.
struct NamedShape {
  std::string name;
  PointsF displacement;
};

/// True for the names of identity shapes: those that begin with "identity".
bool is_identity(const std::string& shape_name);

/// Makes parameters and fields: identity first (mean 0, sigma 1, bounds +-3), then expression
/// (bounds 0 and 1), each in the order given; displacements are in metres. Shapes that move nothing
/// are left out. Throws InvalidInput if none is left, or two have one name.
void add_shapes(const std::vector<NamedShape>& shapes, const FaceLoadOptions& options,
                const std::string& source, MorphShape& face);

/// The 68 vertex numbers of array `key` in the JSON file at `path`, each below `vertex_count`.
std::vector<int> read_landmark_vertices(const std::string& path, const std::string& key,
                                        int vertex_count);

/// Puts a landmark at each of the 68 vertices (numbers of `file_vertex`).
void set_landmarks(const std::vector<int>& landmark_file_vertices,
                   const std::vector<int>& file_vertex, const std::string& source,
                   MorphShape& face);

/// Landmarks of the neutral mesh, in its own unit and frame.
std::vector<Eigen::Vector3d> landmark_positions(const Mesh& mesh,
                                                const std::vector<ModelLandmark>& landmarks);

/// For models whose unit is not known: the factor to metres, and the origin in the model's own
/// unit. With landmarks, the distance between the middles of the eyes decides: the metre,
/// decimetre, centimetre or millimetre that makes it 50 to 80 mm, else the factor that makes it 63
/// mm; the origin is 12 mm behind their middle. Without, the height does: 0.12 to 0.6 m, else 0.3
/// m; the origin is the middle of the bounding box.
struct Normalisation {
  double metre_per_unit = 1.0;
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
};
Normalisation normalisation(const Mesh& mesh, const std::vector<ModelLandmark>& landmarks);

/// A face from a neutral mesh and displacements, both in the file's unit: landmarks from
/// `landmark_path` where that file exists (key "landmark_vertices"), then normalisation to metres.
MorphShape assemble(const MeshFile& neutral, std::vector<NamedShape> shapes,
                    const std::string& landmark_path, const std::string& source,
                    const FaceLoadOptions& options);

/// The mesh without the triangles where keep[triangle] is false, and without the vertices that
/// nothing uses then. `old_vertex` gives the former number of each vertex that is left.
Mesh select_triangles(const Mesh& mesh, const std::vector<bool>& keep,
                      std::vector<int>& old_vertex);

/// Centre of the sphere that fits the points best (algebraic least squares).
Eigen::Vector3d sphere_centre(const std::vector<Eigen::Vector3d>& points);

}  // namespace semblance::load
