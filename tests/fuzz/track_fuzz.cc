// Track files: any bytes give a track or InvalidInput.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "parsers.h"
#include "semblance/core/errors.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view content(reinterpret_cast<const char*>(data), size);
  try {
    semblance::parse_track(content, "fuzz");
  } catch (const semblance::InvalidInput&) {
    // The only answer to bad input.
  }
  return 0;
}
