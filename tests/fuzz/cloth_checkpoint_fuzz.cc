// Checkpoints of simulations. The sum is made to fit, so that what lies behind it is reached.
#include <cstddef>
#include <cstdint>
#include <string>

#include "byte_sum.h"
#include "semblance/cloth/checkpoint.h"
#include "semblance/core/errors.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::string bytes(reinterpret_cast<const char*>(data), size);
  for (const bool mend : {false, true}) {
    if (mend) {
      if (bytes.size() < 8) break;
      bytes.resize(bytes.size() - 8);
      const std::uint64_t sum = semblance::byte_sum(bytes);
      bytes.append(reinterpret_cast<const char*>(&sum), sizeof sum);
    }
    try {
      semblance::parse_checkpoint(bytes, "fuzz");
    } catch (const semblance::InvalidInput&) {
      // The only answer to bad input.
    }
  }
  return 0;
}
