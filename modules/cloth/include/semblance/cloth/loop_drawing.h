// A picture of KES tests: the loops of a test over those that were given, and the table of figures.
#pragma once

#include <string>
#include <vector>

#include "semblance/cloth/kes_loops.h"

namespace semblance {

struct LoopDrawing {
  std::string title, subtitle;
  std::string given_label = "given", tested_label = "test";
  KesLoops given, tested;  ///< empty loops are not drawn
  KesLoops readings;       ///< drawn as dots where they are few
  std::vector<FigureComparison> figures;
};

/// An SVG with one panel each for tension and bending along warp and weft and for shear, in KES
/// units, and a table of the figures with their residuals. The same drawing gives the same text.
std::string loops_svg(const LoopDrawing& drawing);
/// Writes it to a file; IoError.
void write_loops_svg(const std::string& path, const LoopDrawing& drawing);

/// "5.52": as many digits as figures are printed with.
std::string figure_text(double value);

}  // namespace semblance
