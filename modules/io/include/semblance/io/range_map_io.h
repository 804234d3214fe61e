// Range maps as a JSON header and pictures (docs/formats/range_map.md).
#pragma once

#include <string>

#include "semblance/geometry/range_map.h"

namespace semblance {

/// How the radii are kept: whole multiples of a step in a 16-bit PNG, or floats in an OpenEXR file.
enum class RangeEncoding { png16, exr };

/// Throws InvalidInput, naming the file, where header and pictures disagree or hold no range map.
RangeMap read_range_map(const std::string& header_path);

/// Writes `header_path` (NAME.json) and beside it NAME.png or NAME.exr with the radii, and
/// NAME_samples.png. With png16 radii are rounded to 1/65535 of the largest. Throws as `validate`.
void write_range_map(const std::string& header_path, const RangeMap& map, RangeEncoding encoding);

}  // namespace semblance
