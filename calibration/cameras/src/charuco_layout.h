// Which cell of a ChArUco sheet holds a marker.
#pragma once

#include <vector>

#include "semblance/cameras/target.h"

namespace semblance {

/// The cells (column, row) of the markers by id: the white ones, row by row from the upper left.
/// The older layout begins with black in the lower left, so that with an even number of rows the
/// upper left is white.
inline std::vector<Eigen::Vector2i> charuco_cells(const Target& target) {
  const int shift = target.legacy ? (target.rows - 1) % 2 : 0;
  std::vector<Eigen::Vector2i> cells;
  for (int row = 0; row < target.rows; ++row) {
    for (int column = 0; column < target.columns; ++column) {
      if ((column + row + shift) % 2 == 1) cells.emplace_back(column, row);
    }
  }
  return cells;
}

}  // namespace semblance
