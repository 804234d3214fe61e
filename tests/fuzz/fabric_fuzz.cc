// Files of fabrics: the first byte chooses the format.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "fabric_parts.h"
#include "semblance/core/errors.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view content(reinterpret_cast<const char*>(data), size);
  try {
    if (content.empty()) return 0;
    const semblance::FabricRecord record =
        content[0] == 'j' ? semblance::parse_fabric_json(content.substr(1), "fuzz")
                          : semblance::parse_fabric_csv(content.substr(1), "fuzz", "");
    // Whatever was accepted can be tested, or fails with one of the two known errors.
    semblance::run_kes_tests(semblance::material_points(record.fabric), {20});
  } catch (const semblance::InvalidInput&) {
    // The only answer to bad input.
  } catch (const semblance::SolverError&) {
    // A fabric that never reaches the test's force.
  }
  return 0;
}
