// Rigs of cameras: any bytes give valid cameras of different names or InvalidInput.
#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string_view>

#include "camera_json.h"
#include "semblance/core/errors.h"
#include "semblance/io/json_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view content(reinterpret_cast<const char*>(data), size);
  try {
    validate(semblance::rig_from_json(semblance::parse_json(content, "fuzz"), "fuzz"), "fuzz");
  } catch (const semblance::InvalidInput&) {
    // The only answer to bad input.
  }
  return 0;
}
