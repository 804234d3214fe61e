// Ways to store a range map, side by side at equal numbers stored.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "semblance/geometry/radial_sweep.h"

namespace semblance::cli {

/// One way at one budget.
struct StoredScan {
  std::string method;
  std::int64_t budget_numbers = 0, numbers = 0;
  double contours = 0.0;  // mean over the columns; 0 for meshes
  RadialError error;
  double store_s = 0.0, restore_s = 0.0;  // making what is stored, and the map from it
};

/// Sweeps, splines and decimated triangle meshes with at most so many contours' worth of numbers.
/// `mesh` is what was scanned; `map` has its voids filled.
std::vector<StoredScan> compare_stored_scans(const RangeMap& map, const Mesh& mesh,
                                             const std::vector<int>& budgets_contours);

std::string comparison_table(const std::vector<StoredScan>& rows);

}  // namespace semblance::cli
