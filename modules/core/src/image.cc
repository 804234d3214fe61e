#include "semblance/core/image.h"

#include <Eigen/Core>
#include <algorithm>

namespace semblance {
namespace {

// One row of the result from the sum of two rows of the source. The number of channels is a
// template parameter where it is common, because the inner loop then becomes vector instructions.
template <int fixed_channels>
void halve_row(const float* sum, int source_width, int channels_in, float* out) {
  const int channels = fixed_channels > 0 ? fixed_channels : channels_in;
  const int pairs = source_width / 2;
  int x = 0;
  if constexpr (fixed_channels == 3) {
    // Four lanes for three channels: the next pixel overwrites the fourth, so the last one is left
    // to the loop below.
    for (; x + 1 < pairs; ++x) {
      const Eigen::Map<const Eigen::Array4f> left(sum + 6 * x), right(sum + 6 * x + 3);
      Eigen::Map<Eigen::Array4f>(out + 3 * x) = 0.25f * (left + right);
    }
  }
  for (; x < pairs; ++x) {
    const float* const left = sum + static_cast<std::ptrdiff_t>(2) * x * channels;
    for (int c = 0; c < channels; ++c) {
      out[x * channels + c] = 0.25f * (left[c] + left[channels + c]);
    }
  }
  if (source_width % 2 != 0) {
    const float* const last = sum + static_cast<std::ptrdiff_t>(2) * pairs * channels;
    for (int c = 0; c < channels; ++c) out[pairs * channels + c] = 0.5f * last[c];
  }
}

}  // namespace

Image downsample_half(const Image& image) {
  Image half((image.width + 1) / 2, (image.height + 1) / 2, image.channels);
  const std::ptrdiff_t row_size = static_cast<std::ptrdiff_t>(image.width) * image.channels;
  const auto halve = image.channels == 1   ? halve_row<1>
                     : image.channels == 3 ? halve_row<3>
                     : image.channels == 4 ? halve_row<4>
                                           : halve_row<0>;
  std::vector<float> sum(row_size);
  for (int y = 0; y < half.height; ++y) {
    const float* const upper = image.pixel(0, 2 * y);
    const float* const lower = image.pixel(0, std::min(2 * y + 1, image.height - 1));
    for (std::ptrdiff_t i = 0; i < row_size; ++i) sum[i] = upper[i] + lower[i];
    halve(sum.data(), image.width, image.channels, half.pixel(0, y));
  }
  return half;
}

void sample_bilinear(const Image& image, float x_px, float y_px, float* out) {
  // Written so that NaN falls on 0: a conversion of NaN to int is undefined.
  const auto clamp_to = [](float value, int last) {
    return value > 0.0f ? std::min(value, static_cast<float>(last)) : 0.0f;
  };
  const float x = clamp_to(x_px - 0.5f, image.width - 1);
  const float y = clamp_to(y_px - 0.5f, image.height - 1);
  const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
  const int x1 = std::min(x0 + 1, image.width - 1), y1 = std::min(y0 + 1, image.height - 1);
  const float fx = x - static_cast<float>(x0), fy = y - static_cast<float>(y0);
  const float* const p00 = image.pixel(x0, y0);
  const float* const p10 = image.pixel(x1, y0);
  const float* const p01 = image.pixel(x0, y1);
  const float* const p11 = image.pixel(x1, y1);
  for (int c = 0; c < image.channels; ++c) {
    const float top = p00[c] + fx * (p10[c] - p00[c]);
    const float bottom = p01[c] + fx * (p11[c] - p01[c]);
    out[c] = top + fy * (bottom - top);
  }
}

}  // namespace semblance
