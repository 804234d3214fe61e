#include "semblance/lips/lip_overlay.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "semblance/core/conventions.h"
#include "semblance/pipeline/overlay.h"

namespace semblance {
namespace {

using Eigen::Vector2d;

// Pictures are RGB, so scalars are (red, green, blue).
const cv::Scalar k_outer{255, 214, 70}, k_inner{110, 205, 255}, k_bridged{255, 140, 0};
const cv::Scalar k_dark{16, 18, 22};
constexpr std::size_t k_trail_frames = 8;
constexpr int k_subpixel_bits = 4;  // cv's fixed-point drawing coordinates
constexpr int k_least_width = 1200;

/// A picture of `source` within `view`, enlarged, with the source's place `origin_px` at its
/// corner.
class Pen {
 public:
  Pen(const cv::Mat& view, const Vector2d& origin_px, double scale, double unit)
      : view_(view), origin_px_(origin_px), scale_(scale), unit_(unit) {}

  void line(const Vector2d& a_px, const Vector2d& b_px, const cv::Scalar& colour) {
    if (drawable(a_px) && drawable(b_px)) {
      cv::line(view_, place(a_px), place(b_px), colour, 1, cv::LINE_AA, k_subpixel_bits);
    }
  }
  void disc(const Vector2d& p, const cv::Scalar& colour) {
    if (drawable(p)) circle(p, 2.0, colour, cv::FILLED);
  }
  void ring(const Vector2d& p, const cv::Scalar& colour) {
    if (drawable(p)) circle(p, 4.0, colour, 2);
  }
  /// Beside p, away from the middle.
  void number(int value, const Vector2d& p, const Vector2d& middle, const cv::Scalar& colour) {
    if (!drawable(p)) return;
    const std::string text = fmt::format("{}", value);
    const double size = 0.36 * unit_;
    int baseline = 0;
    const cv::Size extent = cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, size, 1, &baseline);
    const Vector2d at = scale_ * (p - origin_px_) + 11.0 * unit_ * (p - middle).normalized();
    const cv::Point corner(static_cast<int>(at.x() - 0.5 * extent.width),
                           static_cast<int>(at.y() + 0.5 * extent.height));
    cv::putText(view_, text, corner, cv::FONT_HERSHEY_SIMPLEX, size, k_dark, 3, cv::LINE_AA);
    cv::putText(view_, text, corner, cv::FONT_HERSHEY_SIMPLEX, size, colour, 1, cv::LINE_AA);
  }

 private:
  static bool drawable(const Vector2d& p) { return p.allFinite() && p.cwiseAbs().maxCoeff() < 1e4; }
  cv::Point place(const Vector2d& p) const {
    const Vector2d q =
        integer_centred_from_ours(scale_ * (p - origin_px_)) * (1 << k_subpixel_bits);
    return {static_cast<int>(std::lround(q.x())), static_cast<int>(std::lround(q.y()))};
  }
  void circle(const Vector2d& p, double radius, const cv::Scalar& colour, int thickness) {
    cv::circle(view_, place(p), static_cast<int>(radius * unit_ * (1 << k_subpixel_bits)), colour,
               thickness, cv::LINE_AA, k_subpixel_bits);
  }

  cv::Mat view_;
  Vector2d origin_px_;
  double scale_, unit_;
};

const cv::Scalar& colour_of(std::size_t marker) { return marker < 8 ? k_outer : k_inner; }

bool bridged(const TrackedMarker& m) { return m.marker.state == MarkerState::bridged; }

Vector2d middle_of(const LipEstimate& estimate) {
  Vector2d sum = Vector2d::Zero();
  int count = 0;
  for (const TrackedMarker& m : estimate.markers) {
    if (!m.known()) continue;
    sum += m.marker.position_px;
    ++count;
  }
  return sum / std::max(1, count);
}

void draw_contours(const LipEstimate& estimate, Pen& pen) {
  for (std::size_t i = 0; i < estimate.markers.size(); ++i) {
    const std::size_t next = i / 8 * 8 + (i + 1) % 8;
    const TrackedMarker &a = estimate.markers[i], &b = estimate.markers[next];
    if (!a.known() || !b.known()) continue;
    pen.line(a.marker.position_px, b.marker.position_px,
             bridged(a) || bridged(b) ? k_bridged : colour_of(i));
  }
}

void draw_trail(const LipEstimate& from, const LipEstimate& to, double strength, Pen& pen) {
  for (std::size_t i = 0; i < to.markers.size() && i < from.markers.size(); ++i) {
    if (!from.markers[i].known() || !to.markers[i].known()) continue;
    pen.line(from.markers[i].marker.position_px, to.markers[i].marker.position_px,
             strength * colour_of(i));
  }
}

void draw_markers(const LipEstimate& estimate, Pen& pen) {
  for (std::size_t i = 0; i < estimate.markers.size(); ++i) {
    const TrackedMarker& m = estimate.markers[i];
    if (!m.known()) continue;
    if (bridged(m)) {
      pen.ring(m.marker.position_px, k_bridged);
    } else {
      pen.disc(m.marker.position_px, colour_of(i));
    }
  }
}

/// Outer numbers outside of their contour, inner ones inside.
void draw_numbers(const LipEstimate& estimate, Pen& pen) {
  const Vector2d middle = middle_of(estimate);
  for (std::size_t i = 0; i < estimate.markers.size(); ++i) {
    const TrackedMarker& m = estimate.markers[i];
    if (!m.known()) continue;
    const Vector2d& p = m.marker.position_px;
    pen.number(static_cast<int>(i), p, i < 8 ? middle : Vector2d(2.0 * p - middle),
               bridged(m) ? k_bridged : colour_of(i));
  }
}

cv::Mat view_of(const Rgb8& picture) {
  return {picture.height, picture.width, CV_8UC3, const_cast<std::uint8_t*>(picture.data.data())};
}

}  // namespace

int LipPainter::scale(int source_width) {
  return std::max(1, (k_least_width + source_width - 1) / std::max(1, source_width));
}

void LipPainter::follow_mouth(const LipEstimate& estimate) {
  constexpr double kShare = 0.15;  // of a new frame in the smoothed place
  Eigen::AlignedBox2d box;
  for (const TrackedMarker& m : estimate.markers) {
    if (m.known()) box.extend(m.marker.position_px);
  }
  if (box.isEmpty()) return;
  const double share = mouth_width_px_ == 0.0 ? 1.0 : kShare;
  mouth_px_ += share * (box.center() - mouth_px_);
  mouth_width_px_ += share * (box.sizes().maxCoeff() - mouth_width_px_);
}

void LipPainter::paint_inset(const Rgb8& source, const LipEstimate& estimate, Rgb8& picture) const {
  constexpr double kWidthShare = 0.4, kAspect = 0.8, kMargin = 1.5, kLeastGain = 1.3;
  cv::Mat whole = view_of(picture);
  const double unit = overlay_unit(picture.width);
  const cv::Size size(static_cast<int>(kWidthShare * whole.cols),
                      static_cast<int>(kWidthShare * kAspect * whole.cols));
  const double scale = size.width / (kMargin * mouth_width_px_);
  if (scale < kLeastGain * picture.width / source.width) return;
  const bool mouth_is_left = mouth_px_.x() < 0.5 * source.width;
  const cv::Rect place(mouth_is_left ? whole.cols - size.width : 0, 0, size.width, size.height);
  cv::Mat inset = whole(place);
  const Vector2d origin = mouth_px_ - 0.5 / scale * Vector2d(size.width, size.height);
  const Vector2d first = integer_centred_from_ours(origin + Vector2d::Constant(0.5 / scale));
  const cv::Matx23d source_from_inset(1.0 / scale, 0, first.x(), 0, 1.0 / scale, first.y());
  cv::warpAffine(view_of(source), inset, source_from_inset, size,
                 cv::INTER_LINEAR | cv::WARP_INVERSE_MAP, cv::BORDER_CONSTANT, k_dark);
  Pen pen(inset, origin, scale, unit);
  draw_contours(estimate, pen);
  draw_markers(estimate, pen);
  draw_numbers(estimate, pen);
  cv::rectangle(whole, place, k_dark, std::max(1, static_cast<int>(2.0 * unit)));
}

Rgb8 LipPainter::paint(const Rgb8& source, const LipEstimate& estimate) {
  const int factor = scale(source.width);
  Rgb8 out{factor * source.width, factor * source.height, {}};
  out.data.resize(static_cast<std::size_t>(out.width) * out.height * 3);
  cv::Mat view = view_of(out);
  cv::resize(view_of(source), view, view.size(), 0, 0, cv::INTER_LINEAR);
  const TrackFrame line = to_track_frame(estimate);
  int seen = 0, filled = 0;
  for (const TrackedMarker& m : estimate.markers) {
    seen += m.marker.state == MarkerState::seen ? 1 : 0;
    filled += bridged(m) ? 1 : 0;
  }
  if (estimate.status == TrackStatus::lost) {
    earlier_.clear();
  } else {
    earlier_.push_back(estimate);
    if (earlier_.size() > k_trail_frames) earlier_.pop_front();
    follow_mouth(estimate);
    Pen pen(view, Vector2d::Zero(), factor, overlay_unit(out.width));
    for (std::size_t i = 1; i < earlier_.size(); ++i) {
      const double age = static_cast<double>(i) / static_cast<double>(k_trail_frames);
      draw_trail(earlier_[i - 1], earlier_[i], 0.3 + 0.4 * age, pen);
    }
    draw_contours(estimate, pen);
    draw_markers(estimate, pen);
    if (mouth_width_px_ > 0.0) paint_inset(source, estimate, out);
  }
  const double opening = mouth_opening(estimate);
  paint_status(out, line,
               fmt::format("{} seen  {} bridged  {} absent{}", seen, filled,
                           static_cast<int>(estimate.markers.size()) - seen - filled,
                           std::isfinite(opening) ? fmt::format("  opening {:.2f}", opening) : ""));
  return out;
}

}  // namespace semblance
