// A mouth that moves through key frames.
//
// Source: Moubaraki, Tanaka and Kitamura, "Evaluation of the Homotopy Sweep Technique", ATR
// TR-C-0089 (1993), section 4.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "semblance/geometry/marker_path.h"

namespace semblance {

/// Rows (x, y, z): pixels in the picture, and pixels towards the camera. Markers are ordered as in
/// LipTrack.
using MouthPoints = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// The 16 markers of a key frame.
struct MouthKey {
  int frame = 0;  // number in the track
  double time_s = 0.0;
  std::vector<Eigen::Vector2d> position_px, velocity_px_s;
  std::vector<double> depth_px;
  std::string viseme;  // the depths' source, for reports
};

/// Axes of a mouth in the picture, from its corners (markers 0 and 4): the middle between them, the
/// unit vectors along and downwards, and their distance. Throws InvalidInput where they coincide.
struct MouthFrame {
  Eigen::Vector2d middle_px, along, down;
  double width_px = 0.0;
};
MouthFrame mouth_frame(const std::vector<Eigen::Vector2d>& markers_px);

/// The reference point of the homotopy: on the mouth's vertical axis, in the middle of the widest
/// gap between the four markers nearest to it (2, 6, 10, 14): the opening of an open mouth, a lip
/// of a closed one. So it is never at a marker unless all four coincide.
Eigen::Vector2d mouth_reference(const std::vector<Eigen::Vector2d>& markers_px);

/// Marker paths from key to key. Neighbouring segments share the key's velocity, so the motion in
/// the picture is C1; depth rests at every key.
class MouthMotion {
 public:
  /// At least two keys with increasing times. Each segment's reference point is that of its first
  /// key, or `reference_px`. Throws InvalidInput naming frame and marker.
  explicit MouthMotion(const std::vector<MouthKey>& keys, const MarkerControls& controls = {},
                       const std::optional<Eigen::Vector2d>& reference_px = {});

  double start_s() const { return times_s_.front(); }
  double end_s() const { return times_s_.back(); }
  int marker_count() const { return static_cast<int>(segments_.front().size()); }
  int segment_count() const { return static_cast<int>(segments_.size()); }
  /// The segment that a time falls into; at a key, the one that starts there.
  int segment_at(double time_s) const;

  /// Positions, and velocities (pixels per second) unless null, held before the first key and after
  /// the last one. Matrices are resized.
  void at(double time_s, MouthPoints& position_px, MouthPoints* velocity_px_s = nullptr) const;

 private:
  std::vector<double> times_s_;
  std::vector<std::vector<MarkerPath>> segments_;
};

}  // namespace semblance
