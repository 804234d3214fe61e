// Closed outlines from files: tables of points and SVG drawings (docs/formats/outline.md).
#pragma once

#include <Eigen/Core>
#include <string>

namespace semblance {

/// Points along an outline as columns, in the file's own units with y up (SVG's y is turned round).
///
/// `.csv` and `.txt`: two numbers a line. `.svg`: the drawing's one shape, or the one with this
/// `id`: path, polygon, polyline, circle, ellipse or rect; curves are cut into 32 straight parts
/// each, and the transforms of the shape and the groups around it apply. The first point is not
/// repeated at the end. Throws InvalidInput naming file and line or shape, with the remedy. Whether
/// the outline crosses itself is `require_simple`'s question (geometry/planar_contour.h).
Eigen::Matrix2Xd read_outline(const std::string& path, const std::string& id = "");

}  // namespace semblance
