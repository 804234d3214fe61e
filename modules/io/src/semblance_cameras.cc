// This program's own camera files among the formats.
#include <fmt/format.h>

#include "camera_format.h"
#include "semblance/io/camera_io.h"
#include "semblance/io/text.h"

namespace semblance {
namespace {

bool recognises(const std::string&, std::string_view content) {
  return content.find("\"semblance.camera/1\"") != std::string_view::npos ||
         content.find("\"semblance.rig/1\"") != std::string_view::npos;
}

bool suits(const std::string& path) { return text::lower_extension(path) == ".json"; }

CameraFile read(const std::string& path) { return {.rig = read_rig(path)}; }

std::vector<std::string> write(const std::string& path, const CameraFile& file) {
  if (file.rig.cameras.size() == 1) {
    write_camera(path, file.rig.cameras.front());
  } else {
    write_rig(path, file.rig);
  }
  return {};
}

}  // namespace

const CameraFormat semblance_format{.name = "semblance",
                                    .title = "this program's camera or rig",
                                    .recognises = recognises,
                                    .suits = suits,
                                    .read = read,
                                    .write = write};

}  // namespace semblance
