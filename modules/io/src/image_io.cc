#include "semblance/io/image_io.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <mutex>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "opencv_image.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/conventions.h"
#include "semblance/core/errors.h"
#include "semblance/io/text.h"
#include "semblance/io/video.h"

namespace semblance {

void silence_opencv() {
  static std::once_flag once;
  std::call_once(once, [] {
    setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", /*overwrite=*/0);
    if (std::getenv("OPENCV_LOG_LEVEL") == nullptr) {
      cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    }
  });
}

void check_image_size(const std::string& source, int width, int height) {
  const bool usable =
      width > 0 && height > 0 && width <= largest_image_side && height <= largest_image_side;
  if (usable) return;
  throw InvalidInput(
      fmt::format("{}: has pictures of {} x {} pixels; between 1 and {} in each direction were "
                  "expected. The file may be damaged",
                  source, width, height, largest_image_side));
}

void rgb8_from_bgr(const cv::Mat& bgr, Rgb8& image) {
  image.width = bgr.cols;
  image.height = bgr.rows;
  image.data.resize(static_cast<std::size_t>(bgr.cols) * bgr.rows * 3);
  cv::Mat rgb(bgr.rows, bgr.cols, CV_8UC3, image.data.data());
  cv::cvtColor(bgr, rgb, cv::COLOR_BGR2RGB);
}

void bgr_from_rgb8(const Rgb8& image, cv::Mat& bgr) {
  const cv::Mat rgb(image.height, image.width, CV_8UC3,
                    const_cast<std::uint8_t*>(image.data.data()));
  cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
}

cv::Mat read_bgr(const std::string& path) {
  silence_opencv();
  try {
    return cv::imread(path, cv::IMREAD_COLOR);
  } catch (const cv::Exception&) {
    return {};
  }
}

Image linear_from_rgb8(const Rgb8& image) {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> values{};
    for (int i = 0; i < 256; ++i) values[i] = linear_from_srgb(static_cast<float>(i) / 255.0f);
    return values;
  }();
  Image linear(image.width, image.height, 3);
  for (std::size_t i = 0; i < image.data.size(); ++i) linear.data[i] = table[image.data[i]];
  return linear;
}

Rgb8 rgb8_from_linear(const Image& image) {
  if (image.channels != 3) {
    throw InvalidInput(
        fmt::format("an image of {} channels cannot be written; 3 were expected", image.channels));
  }
  Rgb8 encoded{image.width, image.height, std::vector<std::uint8_t>(image.data.size())};
  std::transform(image.data.begin(), image.data.end(), encoded.data.begin(), [](float linear) {
    return static_cast<std::uint8_t>(std::lround(255.0f * srgb_from_linear(linear)));
  });
  return encoded;
}

Rgb8 read_image_rgb8(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) {
    throw IoError(path + ": cannot be opened: no such file");
  }
  const cv::Mat bgr = read_bgr(path);
  if (bgr.empty()) {
    throw InvalidInput(path + ": is not an image that can be decoded; a PNG or JPEG was expected");
  }
  check_image_size(path, bgr.cols, bgr.rows);
  Rgb8 image;
  rgb8_from_bgr(bgr, image);
  return image;
}

Image read_image(const std::string& path) { return linear_from_rgb8(read_image_rgb8(path)); }

std::vector<std::uint8_t> encode_image(const Rgb8& image, ImageFormat format) {
  check_image_size("image to be written", image.width, image.height);
  cv::Mat bgr;
  bgr_from_rgb8(image, bgr);
  std::vector<std::uint8_t> bytes;
  if (!cv::imencode(format == ImageFormat::png ? ".png" : ".jpg", bgr, bytes)) {
    throw IoError("the image encoder failed");
  }
  return bytes;
}

void require_image_name(const std::string& path) {
  const std::string extension = text::lower_extension(path);
  if (extension != ".png" && extension != ".jpg" && extension != ".jpeg") {
    throw InvalidInput(path + ": an image is written as .png, .jpg or .jpeg");
  }
}

void write_image(const std::string& path, const Rgb8& image) {
  require_image_name(path);
  AtomicFile file(path);
  const bool png = text::lower_extension(path) == ".png";
  const auto bytes = encode_image(image, png ? ImageFormat::png : ImageFormat::jpeg);
  file.stream().write(reinterpret_cast<const char*>(bytes.data()),
                      static_cast<std::streamsize>(bytes.size()));
  file.commit();
}

void write_image(const std::string& path, const Image& linear_rgb) {
  write_image(path, rgb8_from_linear(linear_rgb));
}

}  // namespace semblance
