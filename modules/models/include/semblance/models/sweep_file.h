// Sweep surfaces from files, semblance.sweep/1 (docs/formats/sweep.md).
#pragma once

#include <string>

#include "semblance/geometry/sweep_surface.h"

namespace semblance {

/// Reads a sweep and the contour files it names (relative to its own folder). Throws InvalidInput
/// naming file and key, with the remedy.
SweepSurface read_sweep(const std::string& path);

}  // namespace semblance
