// Scale and axes for cameras that photos alone have placed.
#pragma once

#include <Eigen/Core>
#include <map>
#include <string>
#include <vector>

#include "semblance/cameras/detect.h"
#include "semblance/core/camera.h"
#include "semblance/io/marks_io.h"

namespace semblance {

/// to = scale * (rotation * from) + shift.
struct Similarity {
  double scale = 1.0;
  Rigid3 motion;  // rotation, and the shift in the unit of `to`

  Eigen::Vector3d operator*(const Eigen::Vector3d& point) const {
    return scale * (motion.rotation * point) + motion.translation_m;
  }
};

/// The least-squares similarity between matching columns; with `keep_scale` a motion. Umeyama,
/// "Least-squares estimation of transformation parameters between two point patterns", PAMI 1991.
/// Throws SolverError for less than three points, and for points on a line.
Similarity similarity_between(const Eigen::Matrix3Xd& from, const Eigen::Matrix3Xd& to,
                              bool keep_scale = false);

Similarity similarity_between(const std::vector<Eigen::Vector3d>& from,
                              const std::vector<Eigen::Vector3d>& to, bool keep_scale = false);

/// The pose of a camera when all that it sees, and itself, are moved: it sees the same.
Rigid3 moved_pose(const Similarity& new_from_old, const Rigid3& camera_from_old);

/// Photos' cameras and points with names in one world.
struct Scene {
  std::vector<Camera> cameras;
  std::map<std::string, Eigen::Vector3d> points_m;
};

/// Moves the whole scene; pictures of it stay the same.
void move_scene(Scene& scene, const Similarity& new_from_old);

/// Places marks by the cameras that see them: reprojections in least squares, from the rays'
/// nearest point. Marks that one photo sees, or whose rays hardly differ, are absent.
/// `marks.photos` match the cameras one by one.
std::map<std::string, Eigen::Vector3d> place_marks(const std::vector<Camera>& cameras,
                                                   const std::vector<MarksFile::Photo>& photos);

/// What gives a scene its scale and axes.
struct SceneFrame {
  Similarity world_from_scene;
  bool has_scale = false, has_axes = false;
  std::string text;    // in words, as in "6 known points, 0.4 mm rms"
  double rms_m = 0.0;  // of what was known, after the move
};

/// By what the file knows: its axes and lengths, or else three known points or more. Without any of
/// them nothing moves, nor where the points have deviations: the solve then was in their frame.
/// Throws InvalidInput naming points that are needed but that the photos do not
/// place, and axes on a line.
SceneFrame frame_from_marks(const Scene& scene, const MarksFile& marks);

/// By a sheet that two photos or more show, one detection per camera. Throws InvalidInput where
/// they place less than four of its points.
SceneFrame frame_from_sheet(const Scene& scene, const std::vector<Detection>& detections);

}  // namespace semblance
