// Scanned mouth positions with depth (docs/formats/visemes.md).
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace semblance {

/// The 16 lip markers of one articulation, ordered as in LipTrack, in the face's own frame: metres,
/// x to its left, y up, z out of the nose. Marker 0, left in the picture, is the face's right
/// corner.
struct Viseme {
  static constexpr int marker_count = 16;

  std::string name;
  std::vector<Eigen::Vector3d> markers_m;
};

/// At least one viseme. Throws InvalidInput naming file and entry: other keys or sizes, a name
/// given twice, coordinates that cannot be metres on a face, or corners in the wrong order.
std::vector<Viseme> read_visemes(const std::string& path);
void write_visemes(const std::string& path, const std::vector<Viseme>& visemes);

}  // namespace semblance
