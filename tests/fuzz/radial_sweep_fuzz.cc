// Stored scans.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "parsers.h"
#include "semblance/core/errors.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    semblance::parse_radial_sweep({reinterpret_cast<const char*>(data), size}, "fuzz");
  } catch (const semblance::InvalidInput&) {
    // The only answer to bad input.
  }
  return 0;
}
