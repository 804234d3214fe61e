// Marks in photos: any bytes give finite figures under known names, or InvalidInput.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "parsers.h"
#include "semblance/core/errors.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view content(reinterpret_cast<const char*>(data), size);
  try {
    semblance::parse_marks(content, "fuzz");
  } catch (const semblance::InvalidInput&) {
    // The only answer to bad input.
  }
  return 0;
}
