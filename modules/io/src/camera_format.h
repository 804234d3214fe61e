// What the formats of camera files share.
#pragma once

#include <Eigen/Core>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "semblance/io/camera_formats.h"

namespace semblance {

extern const CameraFormat semblance_format, opencv_format, kalibr_format, aniposelib_format,
    caliscope_format, qualisys_format, colmap_text_format, colmap_binary_format;

/// Camera files are small; anything larger is something else.
inline constexpr std::size_t camera_file_limit_bytes = std::size_t{16} << 20;
/// More cameras than any rig has.
inline constexpr std::size_t most_rig_cameras = 10000;

/// A camera as OpenCV's functions take it: pixel centres at integers.
struct OpenCvCamera {
  std::string name;
  double width = 0, height = 0;
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
  std::vector<double> distortion;  // OpenCV's order, any of its lengths
  bool fisheye = false;
};
/// With the smallest lens that has the coefficients, at the place a camera file without a pose has.
/// Throws InvalidInput naming `source` and the camera.
Camera from_opencv(const OpenCvCamera& camera, const std::string& source);
/// The lens's coefficients in OpenCV's order: none, 4, 5 or 8.
std::vector<double> opencv_distortion(const Camera& camera);
Eigen::Matrix3d opencv_matrix(const Camera& camera);

/// The smallest of pinhole, brown2, brown5 and brown8 that has these coefficients.
void set_brown_lens(Camera& camera, const LensCoefficients& coefficients);

/// The rotation nearest to a matrix; InvalidInput if it is further than the rounding of a file.
Eigen::Quaterniond rotation_from_matrix(const Eigen::Matrix3d& matrix, const std::string& source,
                                        const std::string& camera);

[[noreturn]] void refuse_lens(const std::string& path, const Camera& camera,
                              std::string_view format, std::string_view holds);

/// "not kept: a, b, c", or nothing where all keys are known.
void note_unused(const std::set<std::string>& unused, std::vector<std::string>& notes);
/// Notes that no camera has a pose.
void note_no_poses(std::vector<std::string>& notes);

/// Writes a whole text under its final name.
void write_whole(const std::string& path, std::string_view content);

/// Where a camera stands whose file has no pose.
Rigid3 default_pose();

}  // namespace semblance
