// Between OpenCV's images and ours.
#pragma once

#include <opencv2/core.hpp>
#include <string>

#include "semblance/io/video.h"

namespace semblance {

/// OpenCV and FFmpeg write to stderr on their own; every failure is thrown by this module instead.
/// The environment variables OPENCV_LOG_LEVEL and OPENCV_FFMPEG_LOGLEVEL bring their words back.
void silence_opencv();

/// The most pixels of a side that is believed; beyond it a header is taken for damaged.
inline constexpr int largest_image_side = 16384;

/// Throws InvalidInput, naming `source`, for sizes that no picture has.
void check_image_size(const std::string& source, int width, int height);

void rgb8_from_bgr(const cv::Mat& bgr, Rgb8& image);
/// A copy in OpenCV's order of channels.
void bgr_from_rgb8(const Rgb8& image, cv::Mat& bgr);

/// Empty where the file is no image.
cv::Mat read_bgr(const std::string& path);

}  // namespace semblance
