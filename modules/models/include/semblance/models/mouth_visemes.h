// Depths for the markers of a mouth, from visemes.
//
// Source: Moubaraki, Tanaka and Kitamura, "Evaluation of the Homotopy Sweep Technique", ATR
// TR-C-0089 (1993), section 4.3.4.
#pragma once

#include <vector>

#include "semblance/io/visemes.h"
#include "semblance/models/mouth_motion.h"

namespace semblance {

/// The built-in face at rest and saying "a", "i", "o" and "u".
std::vector<Viseme> builtin_visemes();

/// A viseme laid over a mouth in a picture by the similarity of least squares (no reflection).
struct VisemeMatch {
  int viseme = 0;
  double rms_px = 0.0;      // what is left between the markers
  double scale_px_m = 0.0;  // of the similarity
};
/// The one that fits best.
VisemeMatch closest_viseme(const std::vector<Viseme>& visemes,
                           const std::vector<Eigen::Vector2d>& markers_px);

/// Gives each key the depths of its closest viseme, in pixels by the similarity's scale, relative
/// to the mean depth of all visemes' markers.
void assign_depths(const std::vector<Viseme>& visemes, std::vector<MouthKey>& keys);

}  // namespace semblance
