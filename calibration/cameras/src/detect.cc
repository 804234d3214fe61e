#include "semblance/cameras/detect.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "auto_target.h"
#include "sheet_detectors.h"

namespace semblance {

namespace {

constexpr double kSizeOfUnknown = 1.0;
constexpr int kLeastSide = 32;             // px; nothing can be read in less
constexpr std::size_t kLeastMirrored = 8;  // points, before a mirror image is believed

cv::Mat grey_of(const Rgb8& image) {
  const cv::Mat rgb(image.height, image.width, CV_8UC3,
                    const_cast<std::uint8_t*>(image.data.data()));
  cv::Mat grey;
  cv::cvtColor(rgb, grey, cv::COLOR_RGB2GRAY);
  return grey;
}

Target identify(const Rgb8& image, const Target& automatic, bool& assumed) {
  if (std::min(image.width, image.height) < kLeastSide) return {};
  const double size_m = automatic.size_m > 0.0 ? automatic.size_m : kSizeOfUnknown;
  return identify_sheet(grey_of(image), size_m, assumed);
}

}  // namespace

const char* warning_name(DetectionWarning::Kind kind) {
  using Kind = DetectionWarning::Kind;
  switch (kind) {
    case Kind::mirrored:
      return "mirrored";
    case Kind::wrong_counts:
      return "wrong_counts";
    case Kind::incomplete:
      return "incomplete";
    case Kind::half_turn:
      return "half_turn";
    case Kind::unknown_size:
      return "unknown_size";
    case Kind::assumed_counts:
      return "assumed_counts";
  }
  return "";
}

struct Detector::Impl {
  explicit Impl(const Target& sheet) : target(parse_target(target_text(sheet))) {
    if (target.kind == TargetKind::aprilgrid) tags.emplace(TagSettings{target.border_bits});
  }

  void detect_markers(const cv::Mat& grey, Detection& detection) {
    if (tags) {
      detect_aprilgrid(grey, find_tags(grey, *tags), detection);
    } else {
      detection.inverted = inverted;
      const auto quads = find_aruco(grey, target.dictionary, detection.inverted);
      detect_charuco(grey, quads, detection);
      if (detection.found()) inverted = detection.inverted;
    }
  }

  void detect(const cv::Mat& grey, Detection& detection) {
    switch (target.kind) {
      case TargetKind::chessboard:
        return detect_chessboard(grey, detection);
      case TargetKind::circles:
        return detect_circles(find_dot_lattice(grey), detection);
      case TargetKind::dots:
        return detect_dots(find_dot_lattice(grey), detection);
      default:
        break;
    }
    detect_markers(grey, detection);
    if (detection.found()) return;
    cv::Mat flipped;
    cv::flip(grey, flipped, 1);
    Detection mirror;
    mirror.target = target;
    detect_markers(flipped, mirror);
    if (mirror.ids.size() >= kLeastMirrored) {
      detection.warnings.push_back({DetectionWarning::Kind::mirrored,
                                    "the picture shows the sheet's mirror image: flip it"});
    }
  }

  Target target;
  std::optional<TagDetector> tags;
  bool inverted = false;  // as in the last picture
};

Detector::Detector(const Target& target) : impl_(std::make_unique<Impl>(target)) {}
Detector::~Detector() = default;
Detector::Detector(Detector&&) noexcept = default;

Detection Detector::detect(const Rgb8& image) {
  if (impl_->target.kind == TargetKind::automatic) return semblance::detect(image, impl_->target);
  Detection detection;
  detection.target = impl_->target;
  detection.width = image.width;
  detection.height = image.height;
  if (std::min(image.width, image.height) >= kLeastSide) impl_->detect(grey_of(image), detection);
  return detection;
}

Detection detect(const Rgb8& image, const Target& target) {
  if (target.kind != TargetKind::automatic) return Detector(target).detect(image);
  bool assumed = false;
  const Target sheet = identify(image, target, assumed);
  if (sheet.kind == TargetKind::automatic) {
    Detection none;
    none.width = image.width;
    none.height = image.height;
    return none;
  }
  Detection detection = Detector(sheet).detect(image);
  using Kind = DetectionWarning::Kind;
  if (target.size_m <= 0.0) {
    detection.warnings.push_back(
        {Kind::unknown_size,
         "a picture does not tell sizes: 1 m is assumed; give the size of a "
         "square, a tag or a step as auto:SIZE"});
  }
  if (assumed) {
    detection.warnings.push_back(
        {Kind::assumed_counts, "the sheet is seen in part and may have more columns or rows"});
  }
  return detection;
}

Target identify_target(const std::vector<Rgb8>& images, const Target& automatic) {
  struct Vote {
    Target target;
    int count = 0;
  };
  std::vector<Vote> votes;
  for (const Rgb8& image : images) {
    bool assumed = false;
    const Target seen = identify(image, automatic, assumed);
    if (seen.kind == TargetKind::automatic) continue;
    const auto vote = std::find_if(votes.begin(), votes.end(), [&](const Vote& v) {
      return v.target.kind == seen.kind && v.target.dictionary == seen.dictionary &&
             v.target.border_bits == seen.border_bits && v.target.columns == seen.columns;
    });
    if (vote == votes.end()) {
      votes.push_back({seen, 1});
    } else {
      ++vote->count;
      if (seen.rows > vote->target.rows) vote->target = seen;
    }
  }
  const auto most = std::max_element(
      votes.begin(), votes.end(), [](const Vote& a, const Vote& b) { return a.count < b.count; });
  return most == votes.end() ? Target{} : most->target;
}

}  // namespace semblance
