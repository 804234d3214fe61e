// Calibration sheets as drawings: the black shapes of a sheet, and files to print at true scale.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "semblance/cameras/target.h"

namespace semblance {

struct BlackRectangle {
  Eigen::Vector2d lower_m, upper_m;  // least and greatest coordinates
};

struct BlackDisc {
  Eigen::Vector2d centre_m;
  double radius_m;
};

/// What is black on a sheet, in the sheet's frame. Shapes do not overlap; the ground is white.
struct SheetShapes {
  std::vector<BlackRectangle> rectangles;
  std::vector<BlackDisc> discs;

  /// The least box around all shapes.
  BlackRectangle bounds() const;
};

/// Throws InvalidInput for `auto`, which names no sheet.
SheetShapes sheet_shapes(const Target& target);

/// Paper upright or lying, whichever the sheet needs: a5, a4, a3, a2, a1, a0, letter, legal,
/// tabloid.
std::vector<std::string> paper_names();

/// Writes the sheet at true scale as PDF or SVG (by the extension), with a ruler of 100 mm (shorter
/// where the paper is) to check the printer's scale with and the text of its `--target` below it.
/// Throws InvalidInput where the sheet with a margin of one square (dots: half a step), ruler and
/// text does not fit on the paper, naming a paper that is large enough or the size that fits.
void print_sheet(const Target& target, const std::string& paper, const std::string& path);

}  // namespace semblance
