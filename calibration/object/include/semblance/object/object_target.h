// A known mesh as calibration target.
#pragma once

#include <optional>

#include "semblance/core/image.h"
#include "semblance/core/mesh.h"
#include "semblance/cost/appearance.h"
#include "semblance/cost/surface_equations.h"

namespace semblance {

/// What is known of the surface's colours.
enum class ObjectColours {
  unknown,  // the outline alone is compared
  plain,    // one colour all over: shading tells the normals
  texture,  // a picture of the surface, by the mesh's uvs
};

/// A mesh made ready for comparison with pictures.
struct ObjectTarget {
  /// About its own middle. Long edges are divided, so that its outline is found at many places and
  /// a lens may bend it. Vertices that differ in uvs alone share one normal.
  Mesh mesh;
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();  // the middle, in the file's frame
  double size_m = 0.0;                                 // diagonal of its box
  PointsF normals;                                     // unit, per vertex
  SurfaceTopology topology;
  SurfaceTopology welded;  // the same triangles; vertices at one place are one
  ObjectColours colours = ObjectColours::unknown;
  std::optional<Appearance> appearance;  // absent where colours are unknown
};

/// `mesh` in metres, triangles counter-clockwise seen from outside. `texture`: linear RGB, only for
/// ObjectColours::texture. Throws InvalidInput, naming `source`, for a mesh without triangles, one
/// that is inside out, and a texture without uvs.
ObjectTarget make_object_target(Mesh mesh, ObjectColours colours, const Image& texture,
                                const std::string& source);

}  // namespace semblance
