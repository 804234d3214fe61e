// What a webcam does to light.
#pragma once

#include <cstdint>

#include "semblance/core/image.h"
#include "semblance/io/video.h"
#include "semblance/synth/clip_spec.h"

namespace semblance {

/// Convolves every channel with a Gaussian of the given deviation; borders are mirrored, so the
/// mean of a constant stays. Nothing happens for sigma_px = 0.
void blur_gaussian(Image& image, double sigma_px);

/// The 8-bit picture a sensor makes of linear RGB light: encoding with the sRGB curve and the tone
/// exponent, Gaussian noise in grey levels, rounding. The noise depends on seed and frame alone.
Rgb8 expose(const Image& linear_rgb, const SensorSpec& sensor, std::uint64_t seed, int frame);

}  // namespace semblance
