// Ways to store a range map, side by side at equal numbers stored.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "semblance/geometry/radial_sweep.h"

namespace semblance {

/// One way at one budget.
struct ScanComparison {
  std::string method;
  std::int64_t budget_numbers = 0, numbers = 0;
  double contours = 0.0;  // mean over the columns; 0 for meshes
  RadialError error;
  double store_s = 0.0, restore_s = 0.0;  // making what is stored, and the map from it
};

/// Sweeps, splines and decimated triangle meshes with at most so many contours' worth of numbers.
/// `mesh` is what was scanned; `map` has its voids filled. Throws InvalidInput for a budget that is
/// too small for one of the methods (6 contours' worth are enough).
std::vector<ScanComparison> compare_stored_scans(const RangeMap& map, const Mesh& mesh,
                                                 const std::vector<int>& budgets_contours);

/// The same as a table for people: millimetres, milliseconds, four bytes per number.
std::string comparison_table(const std::vector<ScanComparison>& rows);

}  // namespace semblance
