// Lip markers over time, as `track lips` writes and `sweep animate` reads them
// (docs/formats/lips.md).
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace semblance {

/// How a marker's place in a frame is known. An absent one has no place.
enum class MarkerState { absent, bridged, seen };
std::string to_string(MarkerState state);

struct LipMarker {
  MarkerState state = MarkerState::absent;
  Eigen::Vector2d position_px = Eigen::Vector2d::Zero();  // meaningful unless absent
  /// Pixels per second; zero where the track could not tell (docs/formats/lips.md).
  Eigen::Vector2d velocity_px_s = Eigen::Vector2d::Zero();
};

struct LipFrame {
  int frame = 0;
  double time_s = 0.0;
  double confidence = 0.0;  // in [0, 1]
  std::vector<LipMarker> markers;
};

/// Markers 0 to 7 lie on the outer contour, 8 to 15 on the inner one (16 markers only). Each
/// contour starts at the corner of the mouth that is left in the picture and runs clockwise as
/// seen: over the upper lip to the other corner (4, 12) and back under the lower lip.
struct LipTrack {
  int marker_count = 0;  // 8 or 16
  std::vector<LipFrame> frames;
};

/// Throws InvalidInput naming file and line: unknown columns, other than 8 or 16 markers, values
/// that are not finite, times that do not increase, or no frame at all.
LipTrack read_lip_markers(const std::string& path);
void write_lip_markers(const std::string& path, const LipTrack& track);

}  // namespace semblance
