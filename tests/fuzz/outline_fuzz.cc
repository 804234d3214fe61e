// Outlines: the first byte chooses the format.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "parsers.h"
#include "semblance/core/errors.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view content(reinterpret_cast<const char*>(data), size);
  try {
    if (content.empty()) return 0;
    content[0] % 2 == 0 ? semblance::parse_outline_table(content.substr(1), "fuzz")
                        : semblance::parse_outline_svg(content.substr(1), "fuzz", "");
  } catch (const semblance::InvalidInput&) {
    // The only answer to bad input.
  }
  return 0;
}
