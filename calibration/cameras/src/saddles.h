// Saddle points of a picture: where four fields of a chessboard meet. Places here have the first
// pixel's centre at (0, 0), as in OpenCV.
#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

namespace semblance {

/// How the picture looks on a circle around a saddle point. Directions are angles from x towards y.
struct SaddleLook {
  double bright_rad = 0.0;            // the middle of the bright fields, modulo pi
  std::array<double, 2> edges_rad{};  // the edges, modulo pi
  double contrast = 0.0;              // bright over dark, grey levels
};

struct Saddle {
  cv::Point2f place;
  SaddleLook look;
};

/// Judges the circle of `radius_px` around a place; none where it has not two bright and two dark
/// fields that face each other, or leaves the picture.
std::optional<SaddleLook> look_at_saddle(const cv::Mat& grey, cv::Point2f place, double radius_px);

/// Moves the place to the saddle point in a window of +- `half_window_px`; none where that is
/// farther than `reach_px` away.
std::optional<cv::Point2f> refine_saddle(const cv::Mat& grey, cv::Point2f place, int half_window_px,
                                         double reach_px);

/// Fits four fields with straight, blurred edges to the pixels within `radius_px`: place,
/// directions of the edges, brightness, contrast and blur, from where `look` says that they are.
/// Stands far more noise and blur than cornerSubPix. None where the pixels do not look like that,
/// or the place is farther than `reach_px` from the start.
std::optional<cv::Point2f> fit_saddle(const cv::Mat& grey, cv::Point2f start,
                                      const SaddleLook& look, double radius_px, double reach_px);

/// All saddle points that are clear, at most `most`, the strongest first.
std::vector<Saddle> find_saddles(const cv::Mat& grey, std::size_t most);

/// The angle between two directions that are known modulo pi, 0 to pi / 2.
double angle_between_axes(double a_rad, double b_rad);

}  // namespace semblance
