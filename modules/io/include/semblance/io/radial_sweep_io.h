// Stored scans, semblance.radial_sweep/1 (docs/formats/radial_sweep.md).
#pragma once

#include <string>

#include "semblance/geometry/radial_sweep.h"

namespace semblance {

/// Throws InvalidInput naming the file and the key that is missing, wrong or out of range.
RadialSweep read_radial_sweep(const std::string& path);

/// Writes every number such that `read_radial_sweep` finds it to the last bit. A slope below the
/// first contour or above the last, which no segment uses, is not kept. Throws as `validate`.
void write_radial_sweep(const std::string& path, const RadialSweep& sweep);

}  // namespace semblance
