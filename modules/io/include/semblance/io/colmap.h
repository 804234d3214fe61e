// Sparse models of COLMAP, as text or binary: a folder with cameras, images and points3D.
//
// Source: COLMAP's documentation, "Output Format" and "Camera Models" (colmap.github.io). Pixels
// are like ours, with the first pixel's centre at (0.5, 0.5); so are the camera's axes.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "semblance/core/rigid3.h"
#include "semblance/io/camera_rig.h"

namespace semblance {

/// Everything in such a folder, by COLMAP's own identifiers. Lengths are in the model's unit, which
/// COLMAP leaves open.
struct ColmapModel {
  struct Intrinsics {
    std::string model;  // "OPENCV"
    int width = 0, height = 0;
    std::vector<double> parameters;  // in COLMAP's order for the model
  };
  static constexpr std::uint64_t no_point = std::numeric_limits<std::uint64_t>::max();
  struct Observation {
    Eigen::Vector2d pixel;
    std::uint64_t point = no_point;
  };
  struct Image {
    Rigid3 camera_from_world;
    std::uint32_t camera = 0;
    std::string name;
    std::vector<Observation> observations;
  };
  struct TrackElement {
    std::uint32_t image = 0, observation = 0;  // observation counts from 0
  };
  struct Point {
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
    std::array<std::uint8_t, 3> colour{};  // sRGB
    double error_px = -1.0;                // mean reprojection error, -1 where unknown
    std::vector<TrackElement> track;
  };

  std::map<std::uint32_t, Intrinsics> cameras;
  std::map<std::uint32_t, Image> images;
  std::map<std::uint64_t, Point> points;
};

/// Throws InvalidInput, naming `source`, unless camera models are known and all figures are finite,
/// images name cameras that are there, and observations and tracks name each other.
void validate(const ColmapModel& model, const std::string& source);

/// Reads a folder; the binary files where it has both. Throws InvalidInput naming file and place.
ColmapModel read_colmap(const std::string& folder);
/// Writes the three files; the folder is made where it is not there. Text cannot hold image names
/// with blanks (InvalidInput).
void write_colmap_text(const std::string& folder, const ColmapModel& model);
void write_colmap_binary(const std::string& folder, const ColmapModel& model);

/// One camera per image, with the image's name; the cameras alone where there is no image.
CameraRig rig_from_colmap(const ColmapModel& model);
/// One COLMAP camera and image per camera, numbered from 1, without observations.
ColmapModel colmap_from_rig(const CameraRig& rig);

}  // namespace semblance
