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

// Where faces have their eyes in the cascade's box, as fractions of its width and height.
constexpr double kEyeDistance = 0.40, kEyeHeight = 0.40;

std::string cascade_path(const std::string& name) {
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

void load(cv::CascadeClassifier& cascade, const std::string& name) {
  const std::string path = cascade_path(name);
  if (!cascade.load(path)) {
    throw InvalidInput("face detector: " + path + " is not a cascade file OpenCV can read");
  }
}

/// The pair of detections that lie most like two eyes in a face's box of size `width`.
std::optional<std::array<Eigen::Vector2d, 2>> choose_eyes(const std::vector<cv::Rect>& found,
                                                          const std::vector<int>& votes,
                                                          double width) {
  std::optional<std::array<Eigen::Vector2d, 2>> best;
  int best_votes = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    for (std::size_t j = 0; j < found.size(); ++j) {
      const auto centre = [](const cv::Rect& r) {
        return Eigen::Vector2d(r.x + 0.5 * r.width, r.y + 0.5 * r.height);
      };
      const Eigen::Vector2d left = centre(found[i]), right = centre(found[j]);
      const Eigen::Vector2d apart = (right - left) / width;
      if (apart.x() < 0.28 || apart.x() > 0.55 || std::abs(apart.y()) > 0.15) continue;
      if (std::abs(0.5 * (left.x() + right.x()) / width - 0.5) > 0.12) continue;
      if (votes[i] + votes[j] <= best_votes) continue;
      best_votes = votes[i] + votes[j];
      best = {left, right};
    }
  }
  return best;
}

}  // namespace

Eigen::Vector2d FaceBox::eye_middle_px() const {
  if (eyes_px) return 0.5 * ((*eyes_px)[0] + (*eyes_px)[1]);
  return {x_px + 0.5 * width_px, y_px + kEyeHeight * height_px};
}

double FaceBox::eye_distance_px() const {
  return eyes_px ? ((*eyes_px)[1] - (*eyes_px)[0]).norm() : kEyeDistance * width_px;
}

struct FaceDetector::Impl {
  cv::CascadeClassifier face, eye;
};

FaceDetector::FaceDetector() : impl_(std::make_unique<Impl>()) {
  load(impl_->face, "haarcascade_frontalface_alt2.xml");
  load(impl_->eye, "haarcascade_eye.xml");
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
  impl_->face.detectMultiScale(small, found, votes, 1.1, 4, 0, cv::Size(least, least));
  std::vector<FaceBox> out;
  for (std::size_t i = 0; i < found.size(); ++i) {
    FaceBox box{found[i].x / scale,      found[i].y / scale, found[i].width / scale,
                found[i].height / scale, votes[i],           std::nullopt};
    // Eyes are sought in the upper part of the box, at the image's own resolution.
    const cv::Rect upper =
        cv::Rect(static_cast<int>(box.x_px), static_cast<int>(box.y_px),
                 static_cast<int>(box.width_px), static_cast<int>(0.65 * box.height_px)) &
        cv::Rect(0, 0, gray.cols, gray.rows);
    if (upper.area() > 0) {
      cv::Mat part = gray(upper).clone();
      const double enlarge = std::max(1.0, 160.0 / part.cols);
      cv::resize(part, part, cv::Size(), enlarge, enlarge, cv::INTER_LINEAR);
      cv::equalizeHist(part, part);
      std::vector<cv::Rect> eyes;
      std::vector<int> eye_votes;
      const int side = static_cast<int>(0.15 * part.cols);
      impl_->eye.detectMultiScale(part, eyes, eye_votes, 1.05, 3, 0, cv::Size(side, side));
      box.eyes_px = choose_eyes(eyes, eye_votes, part.cols);
      if (box.eyes_px) {
        for (Eigen::Vector2d& eye : *box.eyes_px) {
          eye = eye / enlarge + Eigen::Vector2d(upper.x, upper.y);
        }
      }
    }
    out.push_back(box);
  }
  std::sort(out.begin(), out.end(),
            [](const FaceBox& a, const FaceBox& b) { return a.width_px > b.width_px; });
  return out;
}

}  // namespace semblance
