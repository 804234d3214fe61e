// Still images.
#pragma once

#include <string>

#include "semblance/core/image.h"

namespace semblance {

/// Linear RGB from a PNG or JPEG file. Throws InvalidInput if it is none or has no pixels.
Image read_image(const std::string& path);
/// Writes an 8-bit sRGB PNG or JPEG (by extension), through a temporary name.
void write_image(const std::string& path, const Image& linear_rgb);

}  // namespace semblance
