// Camera files of other programs: the first byte chooses the format.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "parsers.h"
#include "semblance/core/errors.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace semblance;
  if (size == 0) return 0;
  const std::string_view content(reinterpret_cast<const char*>(data + 1), size - 1);
  try {
    CameraFile file;
    switch (data[0] % 5) {
      case 0:
        file = parse_toml_cameras(content, "fuzz");
        break;
      case 1:
        file = parse_qualisys(content, "fuzz");
        break;
      case 2:
        file = parse_kalibr(content, "fuzz");
        break;
      case 3:
        file = parse_opencv(content, "fuzz", false);
        break;
      default:
        file = parse_opencv(content, "fuzz", true);
        break;
    }
    validate(file.rig, "fuzz");
  } catch (const InvalidInput&) {
    // The only answer to bad input.
  }
  return 0;
}
