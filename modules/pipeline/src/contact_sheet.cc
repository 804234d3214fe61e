#include "semblance/pipeline/contact_sheet.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace semblance {
namespace {

constexpr int k_jpeg_quality = 78;

Thumbnail reduced(const cv::Mat& picture, const TrackFrame& track) {
  const double factor = std::min(1.0, ContactSheet::k_width_px / static_cast<double>(picture.cols));
  const cv::Size size(std::max(1, static_cast<int>(picture.cols * factor)),
                      std::max(1, static_cast<int>(picture.rows * factor)));
  cv::Mat small;
  cv::resize(picture, small, size, 0, 0, cv::INTER_AREA);
  cv::cvtColor(small, small, cv::COLOR_RGB2BGR);
  Thumbnail out{
      track.frame, track.time_s, track.status, track.residual_rms, size.width, size.height, {}};
  cv::imencode(".jpg", small, out.jpeg, {cv::IMWRITE_JPEG_QUALITY, k_jpeg_quality});
  return out;
}

cv::Mat as_mat(const Rgb8& picture) {
  return {picture.height, picture.width, CV_8UC3, const_cast<std::uint8_t*>(picture.data.data())};
}

/// The part of the picture around the landmarks, in the picture's proportions; the whole picture
/// where there are none.
cv::Rect head_part(const cv::Mat& picture, const TrackFrame& track, int source_width_px) {
  const cv::Rect whole(0, 0, picture.cols, picture.rows);
  Eigen::AlignedBox2d box;
  for (const Eigen::Vector2d& p : track.landmarks_px)
    if (p.allFinite()) box.extend(p);
  if (source_width_px <= 0 || box.isEmpty()) return whole;
  const double scale = picture.cols / static_cast<double>(source_width_px);
  const double aspect = picture.rows / static_cast<double>(picture.cols);
  const double width = scale * 1.7 * std::max(box.sizes().x(), box.sizes().y() / aspect);
  if (width >= picture.cols || width < 16.0) return whole;
  const Eigen::Vector2d corner =
      scale * box.center() - 0.5 * Eigen::Vector2d(width, width * aspect);
  const cv::Rect part(static_cast<int>(std::clamp(corner.x(), 0.0, picture.cols - width)),
                      static_cast<int>(std::clamp(corner.y(), 0.0, picture.rows - width * aspect)),
                      static_cast<int>(width), static_cast<int>(width * aspect));
  return part & whole;
}

}  // namespace

struct ContactSheet::Impl {
  std::vector<Thumbnail> spaced, worst, changes;
  int source_width_px = 0, added = 0, stride = 1;
  TrackStatus previous = TrackStatus::tracked;

  void add_spaced(const Rgb8& picture, const TrackFrame& track) {
    if (added % stride != 0) return;
    if (spaced.size() == k_spaced) {  // every second one stays, and from now on half as many come
      for (std::size_t i = 0; 2 * i < spaced.size(); ++i) std::swap(spaced[i], spaced[2 * i]);
      spaced.resize((spaced.size() + 1) / 2);
      stride *= 2;
      if (added % stride != 0) return;
    }
    spaced.push_back(reduced(as_mat(picture), track));
  }

  Thumbnail head(const Rgb8& picture, const TrackFrame& track) const {
    const cv::Mat whole = as_mat(picture);
    return reduced(whole(head_part(whole, track, source_width_px)), track);
  }

  void add_worst(const Rgb8& picture, const TrackFrame& track) {
    if (track.status == TrackStatus::lost) return;
    const auto near = std::find_if(worst.begin(), worst.end(), [&](const Thumbnail& kept) {
      return track.frame - kept.frame < k_passage_frames;
    });
    if (near != worst.end()) {
      if (near->residual_rms < track.residual_rms) *near = head(picture, track);
      return;
    }
    if (worst.size() == k_worst) {
      const auto best = std::min_element(
          worst.begin(), worst.end(),
          [](const Thumbnail& a, const Thumbnail& b) { return a.residual_rms < b.residual_rms; });
      if (best->residual_rms >= track.residual_rms) return;
      worst.erase(best);
    }
    worst.push_back(head(picture, track));
  }

  void add_change(const Rgb8& picture, const TrackFrame& track) {
    const bool change = track.status != previous && track.status != TrackStatus::tracked;
    previous = track.status;
    if (change && changes.size() < k_changes) changes.push_back(reduced(as_mat(picture), track));
  }
};

ContactSheet::ContactSheet(int source_width_px) : impl_(std::make_unique<Impl>()) {
  impl_->source_width_px = source_width_px;
}
ContactSheet::~ContactSheet() = default;
ContactSheet::ContactSheet(ContactSheet&&) noexcept = default;
ContactSheet& ContactSheet::operator=(ContactSheet&&) noexcept = default;

void ContactSheet::add(const Rgb8& picture, const TrackFrame& track) {
  impl_->add_spaced(picture, track);
  impl_->add_worst(picture, track);
  impl_->add_change(picture, track);
  ++impl_->added;
}

std::vector<Thumbnail> ContactSheet::spaced() const { return impl_->spaced; }

std::vector<Thumbnail> ContactSheet::worst() const {
  std::vector<Thumbnail> sorted = impl_->worst;
  std::stable_sort(sorted.begin(), sorted.end(), [](const Thumbnail& a, const Thumbnail& b) {
    return a.residual_rms > b.residual_rms;
  });
  return sorted;
}

std::vector<Thumbnail> ContactSheet::changes() const { return impl_->changes; }

}  // namespace semblance
