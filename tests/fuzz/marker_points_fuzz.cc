// Dots on an object: any bytes give points with different names and unit normals, or InvalidInput.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <string_view>

#include "semblance/core/errors.h"
#include "semblance/io/json_file.h"
#include "semblance/io/marker_points.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view content(reinterpret_cast<const char*>(data), size);
  try {
    const auto points =
        semblance::marker_points_from_json(semblance::parse_json(content, "fuzz"), "fuzz");
    for (const semblance::MarkerPoint& point : points) {
      if (point.name.empty() || !point.position_m.allFinite()) std::abort();
      if (point.normal && !(std::abs(point.normal->norm() - 1.0) < 1e-9)) std::abort();
    }
  } catch (const semblance::InvalidInput&) {
    // The only answer to bad input.
  }
  return 0;
}
