// The readers of text and bytes behind the readers of files: for the latter, and for fuzzing.
// `source` names the input in messages.
#pragma once

#include <string>
#include <string_view>

#include "semblance/io/camera_formats.h"
#include "semblance/io/gltf_skin.h"
#include "semblance/io/lip_markers.h"
#include "semblance/io/marks_io.h"
#include "semblance/io/mesh_io.h"
#include "semblance/io/outline_io.h"
#include "semblance/io/points.h"
#include "semblance/io/radial_sweep_io.h"
#include "semblance/io/track_file.h"
#include "semblance/io/visemes.h"

namespace semblance {

MeshFile parse_obj(std::string_view content, const std::string& source);
Mesh parse_ply(std::string_view content, const std::string& source);
SkinnedMesh parse_gltf_skin(std::string_view content, const std::string& source);
std::vector<Eigen::Vector2d> parse_pts(std::string_view content, const std::string& source);
std::vector<Eigen::Vector2d> parse_json_points(std::string_view content, const std::string& source);
LipTrack parse_lip_markers(std::string_view content, const std::string& source);
MarksFile parse_marks(std::string_view content, const std::string& source);
Eigen::Matrix2Xd parse_outline_table(std::string_view content, const std::string& source);
Eigen::Matrix2Xd parse_outline_svg(std::string_view content, const std::string& source,
                                   const std::string& id);
RadialSweep parse_radial_sweep(std::string_view content, const std::string& source);
Track parse_track(std::string_view content, const std::string& source);
CameraFile parse_toml_cameras(std::string_view content, const std::string& source);
CameraFile parse_kalibr(std::string_view content, const std::string& source);
CameraFile parse_opencv(std::string_view content, const std::string& source, bool xml);
CameraFile parse_qualisys(std::string_view content, const std::string& source);
std::vector<Viseme> parse_visemes(std::string_view content, const std::string& source);

}  // namespace semblance
