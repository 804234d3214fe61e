// Camera files: any bytes give a valid camera or InvalidInput.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include <nlohmann/json.hpp>

#include "camera_json.h"
#include "semblance/core/errors.h"
#include "semblance/io/json_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view content(reinterpret_cast<const char*>(data), size);
  try {
    const auto json = semblance::parse_json(content, "fuzz");
    validate(semblance::camera_from_json(json, "fuzz"), "fuzz");
  } catch (const semblance::InvalidInput&) {
    // The only answer to bad input.
  }
  return 0;
}
