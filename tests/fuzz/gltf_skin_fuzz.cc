// Skins of glTF files: any bytes give a skin that can be posed, or InvalidInput.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "parsers.h"
#include "semblance/core/errors.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view content(reinterpret_cast<const char*>(data), size);
  try {
    const semblance::SkinnedMesh skin =
        semblance::without_seams(semblance::parse_gltf_skin(content, "/nonexistent/fuzz.glb"));
    semblance::validate(skin, "fuzz");
    for (const semblance::SkinAnimation& animation : skin.animations) {
      const double middle_s = 0.5 * animation.end_s();
      semblance::skinned_positions(skin, semblance::animated_pose(skin.nodes, animation, middle_s));
    }
  } catch (const semblance::InvalidInput&) {
    // The only answer to bad input.
  }
  return 0;
}
