// The header of a range map, apart from its pictures: for the reader and for fuzzing.
#pragma once

#include <string>
#include <string_view>

#include "semblance/io/range_map_io.h"

namespace semblance {

struct RangeMapHeader {
  int rows = 0, columns = 0;
  double bottom_m = 0.0, spacing_m = 0.0, radius_step_m = 0.0;  // the step of png16
  Rigid3 world_from_map;
  RangeEncoding encoding = RangeEncoding::png16;
  std::string radius_file, samples_file;  // names in the header's folder
};

/// Throws InvalidInput naming `source` and the key that is missing or wrong.
RangeMapHeader parse_range_map_header(std::string_view text, const std::string& source);
std::string format_range_map_header(const RangeMapHeader& header);

}  // namespace semblance
