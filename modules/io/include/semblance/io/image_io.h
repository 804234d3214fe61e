// Still images.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "semblance/core/image.h"

namespace semblance {

struct Rgb8;

enum class ImageFormat { png, jpeg };

/// Linear RGB from a PNG or JPEG file. Throws InvalidInput if it is none or has no pixels.
Image read_image(const std::string& path);
/// The same without linearisation.
Rgb8 read_image_rgb8(const std::string& path);

/// Throws InvalidInput unless the name is one that `write_image` takes.
void require_image_name(const std::string& path);
/// Writes an 8-bit sRGB PNG or JPEG (by extension), through a temporary name.
void write_image(const std::string& path, const Image& linear_rgb);
void write_image(const std::string& path, const Rgb8& image);

/// The bytes of such a file, for embedding in others.
std::vector<std::uint8_t> encode_image(const Rgb8& image, ImageFormat format);

}  // namespace semblance
