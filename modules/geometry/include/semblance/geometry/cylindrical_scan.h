// A virtual cylindrical digitizer.
#pragma once

#include <optional>

#include "semblance/core/mesh.h"
#include "semblance/geometry/range_map.h"

namespace semblance {

struct ScanOptions {
  int columns = 512, rows = 512;
  /// Direction of the axis, and the direction of the map's middle column; any lengths but zero, and
  /// not parallel.
  Eigen::Vector3d up = Eigen::Vector3d::UnitY(), front = Eigen::Vector3d::UnitZ();
  /// A point of the axis; by default the middle of the mesh's bounding box in the map's frame.
  std::optional<Eigen::Vector3d> axis_point_m;
};

/// Radii of the mesh as a digitizer that circles the axis records them: for every row and angle the
/// outermost crossing of the horizontal ray from the axis with a triangle, exact to rounding, and
/// void where there is none (ATR TR-C-0089, section 3.2.1; what the digitizer's laser or camera
/// would not reach is seen here). Rows are the middles of equal bands from the mesh's lowest point
/// to its highest, so that the topmost one still meets it. Throws InvalidInput for a mesh without
/// triangles or height, an axis that no ray leaves towards the mesh, and options out of range.
RangeMap scan_cylinder(const Mesh& mesh, const ScanOptions& options = {});

/// The same with the rows, columns and frame of another map, to compare surfaces sample by sample.
RangeMap scan_like(const Mesh& mesh, const RangeMap& other);

}  // namespace semblance
