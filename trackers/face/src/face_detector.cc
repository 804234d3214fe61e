#include "semblance/face/face_detector.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <opencv2/imgproc.hpp>
#include <opencv2/objdetect.hpp>
#include <string>

#include "semblance/core/conventions.h"
#include "semblance/core/errors.h"

namespace semblance {

namespace {

constexpr int kDetectionWidth = 320;  // a face of a fifth of the picture is still 60 px wide

std::string cascade_path() {
  const std::string name = "haarcascade_frontalface_alt2.xml";
  std::vector<std::string> folders;
  if (const char* chosen = std::getenv("SEMBLANCE_CASCADES")) folders.emplace_back(chosen);
  folders.emplace_back("/usr/share/opencv4/haarcascades");
  folders.emplace_back("/usr/local/share/opencv4/haarcascades");
  std::string searched;
  for (const std::string& folder : folders) {
    const std::filesystem::path path = std::filesystem::path(folder) / name;
    if (std::filesystem::exists(path)) return path.string();
    searched += " " + folder;
  }
  throw InvalidInput("face detector: " + name + " not found in" + searched +
                     "; install the package opencv-data, or set SEMBLANCE_CASCADES to its folder");
}

}  // namespace

struct FaceDetector::Impl {
  cv::CascadeClassifier cascade;
};

FaceDetector::FaceDetector() : impl_(std::make_unique<Impl>()) {
  const std::string path = cascade_path();
  if (!impl_->cascade.load(path)) {
    throw InvalidInput("face detector: " + path + " is not a cascade file OpenCV can read");
  }
}

FaceDetector::~FaceDetector() = default;

std::vector<FaceBox> FaceDetector::detect(const Image& linear_rgb) const {
  cv::Mat gray(linear_rgb.height, linear_rgb.width, CV_8U);
  for (int y = 0; y < linear_rgb.height; ++y) {
    for (int x = 0; x < linear_rgb.width; ++x) {
      const float* p = linear_rgb.pixel(x, y);
      const float luminance = 0.2126f * p[0] + 0.7152f * p[1] + 0.0722f * p[2];
      gray.at<std::uint8_t>(y, x) =
          static_cast<std::uint8_t>(255.0f * srgb_from_linear(luminance) + 0.5f);
    }
  }
  const double scale = std::min(1.0, static_cast<double>(kDetectionWidth) / gray.cols);
  cv::Mat small;
  cv::resize(gray, small, cv::Size(), scale, scale, cv::INTER_AREA);
  cv::equalizeHist(small, small);
  std::vector<cv::Rect> found;
  std::vector<int> votes;
  const int least = std::max(24, small.rows / 10);
  impl_->cascade.detectMultiScale(small, found, votes, 1.1, 4, 0, cv::Size(least, least));
  std::vector<FaceBox> out;
  for (std::size_t i = 0; i < found.size(); ++i) {
    out.push_back({found[i].x / scale, found[i].y / scale, found[i].width / scale,
                   found[i].height / scale, votes[i]});
  }
  std::sort(out.begin(), out.end(),
            [](const FaceBox& a, const FaceBox& b) { return a.width_px > b.width_px; });
  return out;
}

}  // namespace semblance
