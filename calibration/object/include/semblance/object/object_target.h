// A known mesh as calibration target.
#pragma once

#include <optional>

#include "semblance/core/image.h"
#include "semblance/core/mesh.h"
#include "semblance/cost/appearance.h"
#include "semblance/cost/surface_equations.h"

namespace semblance {

/// A mesh made ready for comparison with pictures.
struct ObjectTarget {
  /// About its own middle. Long edges are divided, so that its outline is found at many places and
  /// a lens may bend it. Vertices that differ in uvs alone share one normal.
  Mesh mesh;
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();  // the middle, in the file's frame
  double size_m = 0.0;                                 // diagonal of its box
  PointsF normals;                                     // unit, per vertex
  SurfaceTopology topology;
  SurfaceTopology welded;                // the same triangles; vertices at one place are one
  std::optional<Appearance> appearance;  // absent without a texture: the outline alone counts
};

/// `mesh` in metres, triangles counter-clockwise seen from outside. `texture`: linear RGB, laid on
/// by the mesh's uvs; may be empty. Throws InvalidInput, naming `source`, for a mesh without
/// triangles, one that is inside out, and a texture without uvs.
ObjectTarget make_object_target(Mesh mesh, const Image& texture, const std::string& source);

}  // namespace semblance
