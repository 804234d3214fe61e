// Drawings of a mouth's motion and wireframe, as the report's Figures 24 and 25 have them.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "semblance/models/mouth_motion.h"
#include "semblance/models/mouth_wireframe.h"

namespace semblance {

/// Of the segment in which the markers go furthest: the markers of both key frames, the paths and
/// velocities between them, and for the marker that goes furthest the frame (O, u_r, u_theta) and
/// the components r and w halfway. `reference_px` as it was given to the motion.
void write_paths_svg(const std::string& path, const std::vector<MouthKey>& keys,
                     const MouthMotion& motion, const std::optional<Eigen::Vector2d>& reference_px);

/// The four contours with the markers (large) and the points between them at the first key frame.
void write_wireframe_svg(const std::string& path, const MouthWireframe& wireframe,
                         const MouthMotion& motion);

}  // namespace semblance
