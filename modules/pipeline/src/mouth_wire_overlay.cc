#include "mouth_wire_overlay.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "semblance/core/conventions.h"
#include "semblance/pipeline/overlay.h"

namespace semblance {
namespace {

// Pictures are RGB, so scalars are (red, green, blue).
const cv::Scalar wire_colour{140, 225, 255}, marker_colour{255, 214, 70},
    text_colour{240, 240, 240};
constexpr int subpixel_bits = 4;

/// For cv's drawing, whose coordinates are integers; far outside is outside.
int fixed_point(double at_px) {
  constexpr double farthest_px = 20000.0;
  if (!std::isfinite(at_px)) return 0;
  return static_cast<int>(
      std::lround(std::clamp(at_px, -farthest_px, farthest_px) * (1 << subpixel_bits)));
}

cv::Point fixed_point(const MouthPoints& points_px, int row, int scale) {
  const Eigen::Vector2d at =
      integer_centred_from_ours(scale * points_px.row(row).head<2>().transpose());
  return {fixed_point(at.x()), fixed_point(at.y())};
}

}  // namespace

MouthWireOverlay::MouthWireOverlay(const MouthWireframe& wireframe, int source_width,
                                   int source_height)
    : wireframe_(wireframe),
      source_width_(source_width),
      source_height_(source_height),
      scale_(overlay_scale(source_width)) {}

Rgb8 MouthWireOverlay::paint(const Rgb8& source, const MouthPoints& markers,
                             const std::string& text) {
  Rgb8 result{width(), height(), {}};
  result.data.resize(std::size_t{3} * width() * height());
  // OpenCV takes no pictures to read only.
  const cv::Mat from(source.height, source.width, CV_8UC3,
                     const_cast<std::uint8_t*>(source.data.data()));
  cv::Mat picture(height(), width(), CV_8UC3, result.data.data());
  cv::resize(from, picture, picture.size(), 0.0, 0.0, cv::INTER_LINEAR);

  wireframe_.evaluate(markers, points_px_);
  const int ring = wireframe_.ring_size();
  const auto line = [&](int a, int b) {
    cv::line(picture, fixed_point(points_px_, a, scale_), fixed_point(points_px_, b, scale_),
             wire_colour, 1, cv::LINE_AA, subpixel_bits);
  };
  for (int c = 0; c < MouthWireframe::contour_count; ++c) {
    for (int k = 0; k < ring; ++k) {
      line(c * ring + k, c * ring + (k + 1) % ring);
      if (c > 0) line((c - 1) * ring + k, c * ring + k);
    }
  }
  const double unit = std::max(1.0, height() / 480.0);
  for (const int contour : {0, MouthWireframe::contour_count - 1}) {
    for (int marker = 0; marker < 8; ++marker) {
      cv::circle(picture, fixed_point(points_px_, wireframe_.index(contour, marker), scale_),
                 static_cast<int>(std::lround(1.8 * unit * (1 << subpixel_bits))), marker_colour,
                 cv::FILLED, cv::LINE_AA, subpixel_bits);
    }
  }
  const cv::Point corner(int(10 * unit), height() - int(12 * unit));
  cv::putText(picture, text, corner, cv::FONT_HERSHEY_SIMPLEX, 0.5 * unit, {16, 18, 22}, 4,
              cv::LINE_AA);
  cv::putText(picture, text, corner, cv::FONT_HERSHEY_SIMPLEX, 0.5 * unit, text_colour, 1,
              cv::LINE_AA);
  return result;
}

}  // namespace semblance
