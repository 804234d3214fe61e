#include <algorithm>
#include <cmath>

#include "semblance/core/conventions.h"

namespace semblance {

float linear_from_srgb(float encoded) {
  if (encoded <= 0.04045f) return encoded / 12.92f;
  return std::pow((encoded + 0.055f) / 1.055f, 2.4f);
}

float srgb_from_linear(float linear) {
  const float clamped = std::clamp(linear, 0.0f, 1.0f);
  if (clamped <= 0.0031308f) return 12.92f * clamped;
  return 1.055f * std::pow(clamped, 1.0f / 2.4f) - 0.055f;
}

}  // namespace semblance
