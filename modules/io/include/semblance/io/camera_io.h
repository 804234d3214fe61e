// This program's camera file, semblance.camera/1 (docs/formats/camera.md).
#pragma once

#include <string>

#include "semblance/core/camera.h"

namespace semblance {

/// Throws InvalidInput naming file and key for anything missing, unknown, non-finite or out of
/// range.
Camera read_camera(const std::string& path);
void write_camera(const std::string& path, const Camera& camera);

}  // namespace semblance
