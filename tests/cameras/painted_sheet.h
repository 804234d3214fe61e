// Pictures of calibration sheets with exact truth: a camera with division-model distortion looks at
// a sheet of black shapes; 32 samples for each pixel, blur and noise in linear light.
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

#include "semblance/cameras/print_sheet.h"
#include "semblance/core/conventions.h"
#include "semblance/core/random.h"
#include "semblance/io/video.h"

namespace semblance::testing {

/// How the sheet is seen. Angles turn the sheet about its centre, which lies in the picture's
/// middle.
struct SheetView {
  double tilt_rad = 0.0;  // out of the picture's plane, about an axis at `axis_rad` in it
  double axis_rad = 0.0;
  double roll_rad = 0.0;    // in the picture's plane
  double fill = 0.75;       // the sheet's longer side in parts of the picture's shorter one
  double distortion = 0.0;  // lambda: r_undistorted = r / (1 + lambda r^2), r in focal lengths
  Eigen::Vector2d shift_px{0.0, 0.0};
  double blur_px = 0.7;
  double noise = 0.005;  // of a pixel, linear light, 0 to 1
  int width = 640, height = 480;
};

class PaintedSheet {
 public:
  PaintedSheet(const Target& target, const SheetView& view)
      : view_(view), shapes_(sheet_shapes(target)), box_(shapes_.bounds()) {
    const Eigen::Vector2d extent = box_.upper_m - box_.lower_m;
    const Eigen::Vector2d centre = 0.5 * (box_.upper_m + box_.lower_m);
    focal_px_ = 1.1 * view.width;
    const double distance =
        focal_px_ * extent.maxCoeff() / (view.fill * std::min(view.width, view.height));
    const Eigen::Vector3d axis(std::cos(view.axis_rad), std::sin(view.axis_rad), 0.0);
    const Eigen::Matrix3d turn = (Eigen::AngleAxisd(view.tilt_rad, axis) *
                                  Eigen::AngleAxisd(view.roll_rad, Eigen::Vector3d::UnitZ()))
                                     .toRotationMatrix();
    ray_from_sheet_.leftCols<2>() = turn.leftCols<2>();
    ray_from_sheet_.col(2) = Eigen::Vector3d(0.0, 0.0, distance) - turn.leftCols<2>() * centre;
    sheet_from_ray_ = ray_from_sheet_.inverse();
    fill_buckets();
  }

  /// Where a place of the sheet is in the picture.
  Eigen::Vector2d project(const Eigen::Vector2d& sheet_m) const {
    return distorted((ray_from_sheet_ * sheet_m.homogeneous()).hnormalized());
  }

  /// The centre of the ellipse that a circle on the sheet becomes (no distortion).
  Eigen::Vector2d ellipse_centre(const BlackDisc& disc) const {
    Eigen::Matrix3d dual = Eigen::Vector3d(1.0, 1.0, 0.0).asDiagonal();
    dual *= disc.radius_m * disc.radius_m;
    const Eigen::Vector3d centre = disc.centre_m.homogeneous();
    dual -= centre * centre.transpose();
    const Eigen::Matrix3d image = ray_from_sheet_ * dual * ray_from_sheet_.transpose();
    return distorted(image.col(2).head<2>() / image(2, 2));
  }

  Rgb8 paint(std::uint64_t seed, double black = 0.04, double white = 0.75) const {
    // Columns and rows of samples differ for each, so that upright edges are as smooth as others.
    constexpr int kSamples = 32;
    cv::Mat light(view_.height, view_.width, CV_32F);
    for (int y = 0; y < view_.height; ++y) {
      for (int x = 0; x < view_.width; ++x) {
        int dark = 0;
        if (const auto whole = uniform(x, y)) {
          light.at<float>(y, x) = static_cast<float>(*whole ? black : white);
          continue;
        }
        for (int k = 0; k < kSamples; ++k) {
          const Eigen::Vector2d p(x + (k + 0.5) / kSamples,
                                  y + ((k * 13) % kSamples + 0.5) / kSamples);
          dark += is_black(sheet_at(p)) ? 1 : 0;
        }
        light.at<float>(y, x) =
            static_cast<float>(white + (black - white) * dark / static_cast<double>(kSamples));
      }
    }
    if (view_.blur_px > 0.0) cv::GaussianBlur(light, light, {}, view_.blur_px);
    Random random(seed);
    Rgb8 image{view_.width, view_.height, {}};
    image.data.reserve(light.total() * 3);
    for (const float value : cv::Mat_<float>(light)) {
      const float noisy = value + static_cast<float>(random.normal() * view_.noise);
      const auto grey = static_cast<std::uint8_t>(
          std::lround(255.0f * srgb_from_linear(std::clamp(noisy, 0.0f, 1.0f))));
      image.data.insert(image.data.end(), 3, grey);
    }
    return image;
  }

  const SheetShapes& shapes() const { return shapes_; }

 private:
  static constexpr int kBuckets = 64;

  Eigen::Vector2d middle() const {
    return Eigen::Vector2d(0.5 * view_.width, 0.5 * view_.height) + view_.shift_px;
  }

  Eigen::Vector2d distorted(const Eigen::Vector2d& undistorted) const {
    const double r = undistorted.norm(), l = view_.distortion;
    if (std::abs(l) * r * r < 1e-12) return middle() + focal_px_ * undistorted;
    const double seen = (1.0 - std::sqrt(1.0 - 4.0 * l * r * r)) / (2.0 * l * r);
    return middle() + focal_px_ * undistorted * (seen / r);
  }

  Eigen::Vector2d sheet_at(const Eigen::Vector2d& pixel) const {
    const Eigen::Vector2d seen = (pixel - middle()) / focal_px_;
    const Eigen::Vector2d ray = seen / (1.0 + view_.distortion * seen.squaredNorm());
    return (sheet_from_ray_ * ray.homogeneous()).hnormalized();
  }

  Eigen::Vector2i bucket(const Eigen::Vector2d& p) const {
    const Eigen::Vector2d share = (p - box_.lower_m).cwiseQuotient(box_.upper_m - box_.lower_m);
    return (share * kBuckets).array().floor().cast<int>().cwiseMax(0).cwiseMin(kBuckets - 1);
  }

  template <typename Put>
  void for_buckets(const Eigen::Vector2d& lower, const Eigen::Vector2d& upper, const Put& put) {
    const Eigen::Vector2i first = bucket(lower), last = bucket(upper);
    for (int y = first.y(); y <= last.y(); ++y) {
      for (int x = first.x(); x <= last.x(); ++x) put(y * kBuckets + x);
    }
  }

  void fill_buckets() {
    rectangles_.resize(kBuckets * kBuckets);
    discs_.resize(kBuckets * kBuckets);
    for (const BlackRectangle& r : shapes_.rectangles) {
      for_buckets(r.lower_m, r.upper_m, [&](int b) { rectangles_[b].push_back(r); });
    }
    for (const BlackDisc& d : shapes_.discs) {
      const Eigen::Vector2d reach = Eigen::Vector2d::Constant(d.radius_m);
      for_buckets(d.centre_m - reach, d.centre_m + reach, [&](int b) { discs_[b].push_back(d); });
    }
  }

  /// The colour of a pixel whose corners and middle agree: shapes are wider than a pixel.
  std::optional<bool> uniform(int x, int y) const {
    const bool first = is_black(sheet_at({x + 0.5, y + 0.5}));
    for (const Eigen::Vector2d& p : {Eigen::Vector2d(x, y), Eigen::Vector2d(x + 1, y),
                                     Eigen::Vector2d(x, y + 1), Eigen::Vector2d(x + 1, y + 1)}) {
      if (is_black(sheet_at(p)) != first) return std::nullopt;
    }
    return first;
  }

  bool is_black(const Eigen::Vector2d& p) const {
    if ((p.array() < box_.lower_m.array()).any() || (p.array() > box_.upper_m.array()).any()) {
      return false;
    }
    const Eigen::Vector2i at = bucket(p);
    for (const BlackRectangle& r : rectangles_[at.y() * kBuckets + at.x()]) {
      if ((p.array() >= r.lower_m.array()).all() && (p.array() < r.upper_m.array()).all()) {
        return true;
      }
    }
    for (const BlackDisc& d : discs_[at.y() * kBuckets + at.x()]) {
      if ((p - d.centre_m).squaredNorm() < d.radius_m * d.radius_m) return true;
    }
    return false;
  }

  SheetView view_;
  SheetShapes shapes_;
  BlackRectangle box_;
  double focal_px_ = 0.0;
  Eigen::Matrix3d ray_from_sheet_, sheet_from_ray_;
  std::vector<std::vector<BlackRectangle>> rectangles_;
  std::vector<std::vector<BlackDisc>> discs_;
};

}  // namespace semblance::testing
