// glTF with morph targets: any bytes give a valid face or InvalidInput.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "load_face_parts.h"
#include "semblance/core/errors.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view content(reinterpret_cast<const char*>(data), size);
  try {
    validate(semblance::load::gltf_face_from_bytes(content, "/nonexistent/fuzz.glb", {}), "fuzz");
  } catch (const semblance::InvalidInput&) {
    // The only answer to bad input.
  }
  return 0;
}
