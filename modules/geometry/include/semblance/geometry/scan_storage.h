// The ways to store a range map as a radial sweep, chosen by name and size.
#pragma once

#include <optional>

#include "semblance/geometry/radial_sweep.h"

namespace semblance {

/// What is kept of a scan. Source: ATR TR-C-0089 (1993), sections 3.2.4 and 3.3.1.
enum class StorageMethod {
  null,       ///< contours; vertical tangents between them (figure 17)
  one_sided,  ///< and the slopes on both sides of each (figure 19)
  averaged,   ///< and the mean of both slopes (figure 20)
  fitted,     ///< the same, and n by least squares
  full,       ///< `sweep_placed`
};

struct StorageOptions {
  StorageMethod method = StorageMethod::full;
  SweepForm form = SweepForm::double_scaling;  // of all methods but full
  BlendShare share = BlendShare::pair;         // of fitted
  double n = 0.0;                              // of null, one_sided and averaged; > -1
  int every = 10;                              // one contour in so many rows; full: as many numbers
  std::optional<int> budget_contours;          // instead: at most the numbers of so many contours
  int panel_columns = 32;                      // of full
};

/// Stores a map whose voids are filled. Throws InvalidInput where the options leave fewer than two
/// contours, or as `sweep_measured` and `sweep_placed` do.
RadialSweep store_scan(const RangeMap& map, const StorageOptions& options);

}  // namespace semblance
