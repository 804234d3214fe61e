#include "saddles.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

namespace semblance {

namespace {

constexpr double kPi = std::numbers::pi;
constexpr int kSamples = 32;  // on a circle; even
constexpr double kLeastContrast = 12.0;
constexpr double kRadius = 4.0;
constexpr int kHalfWindow = 3;

double grey_at(const cv::Mat& grey, double x, double y) {
  const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
  const double fx = x - x0, fy = y - y0;
  const auto* upper = grey.ptr<std::uint8_t>(y0) + x0;
  const auto* lower = grey.ptr<std::uint8_t>(y0 + 1) + x0;
  return (1 - fy) * ((1 - fx) * upper[0] + fx * upper[1]) +
         fy * ((1 - fx) * lower[0] + fx * lower[1]);
}

bool inside(const cv::Mat& grey, cv::Point2f place, double margin) {
  return place.x >= margin && place.y >= margin && place.x < grey.cols - 1 - margin &&
         place.y < grey.rows - 1 - margin;
}

/// Where the samples of half a turn cross the level between bright and dark; two for a saddle.
std::vector<double> crossings(const std::array<double, kSamples / 2>& half_turn, double level) {
  std::vector<double> found;
  for (int i = 0; i < kSamples / 2; ++i) {
    const double a = half_turn[i] - level;
    const double b = half_turn[(i + 1) % (kSamples / 2)] - level;
    if ((a < 0.0) != (b < 0.0)) found.push_back((i + a / (a - b)) * 2.0 * kPi / kSamples);
  }
  return found;
}

/// -det of the Hessian of the smoothed picture, 0 where it is negative.
cv::Mat saddle_strength(const cv::Mat& grey) {
  cv::Mat smooth, xx, yy, xy;
  grey.convertTo(smooth, CV_32F);
  cv::GaussianBlur(smooth, smooth, {}, 1.5);
  cv::Sobel(smooth, xx, CV_32F, 2, 0);
  cv::Sobel(smooth, yy, CV_32F, 0, 2);
  cv::Sobel(smooth, xy, CV_32F, 1, 1);
  cv::Mat strength = xy.mul(xy) * 16.0 - xx.mul(yy);  // Sobel's xy is 4 times smaller
  cv::max(strength, 0.0, strength);
  return strength;
}

}  // namespace

double angle_between_axes(double a_rad, double b_rad) {
  return std::abs(std::remainder(a_rad - b_rad, kPi));
}

std::optional<SaddleLook> look_at_saddle(const cv::Mat& grey, cv::Point2f place, double radius_px) {
  if (!inside(grey, place, radius_px + 1.0)) return std::nullopt;
  std::array<double, kSamples> ring;
  for (int i = 0; i < kSamples; ++i) {
    const double angle = 2.0 * kPi * i / kSamples;
    ring[i] = grey_at(grey, place.x + radius_px * std::cos(angle),
                      place.y + radius_px * std::sin(angle));
  }
  // Opposite samples are alike: their mean is the signal, their difference must be small.
  std::array<double, kSamples / 2> half_turn;
  double mean = 0.0;
  double unlike = 0.0;
  for (int i = 0; i < kSamples / 2; ++i) {
    half_turn[i] = 0.5 * (ring[i] + ring[i + kSamples / 2]);
    mean += half_turn[i] / (kSamples / 2);
    unlike += 0.25 * std::pow(ring[i] - ring[i + kSamples / 2], 2) / (kSamples / 2);
  }
  double variance = 0.0;
  double cosine = 0.0;
  double sine = 0.0;
  for (int i = 0; i < kSamples / 2; ++i) {
    const double angle = 2.0 * kPi * i / kSamples;
    variance += std::pow(half_turn[i] - mean, 2) / (kSamples / 2);
    cosine += half_turn[i] * std::cos(2.0 * angle);
    sine += half_turn[i] * std::sin(2.0 * angle);
  }
  const auto [darkest, brightest] = std::minmax_element(half_turn.begin(), half_turn.end());
  SaddleLook look;
  look.contrast = *brightest - *darkest;
  if (look.contrast < kLeastContrast || unlike > 0.3 * variance) return std::nullopt;
  const std::vector<double> edges = crossings(half_turn, 0.5 * (*brightest + *darkest));
  if (edges.size() != 2) return std::nullopt;
  look.edges_rad = {edges[0], edges[1]};
  if (angle_between_axes(edges[0], edges[1]) < 0.2) return std::nullopt;
  look.bright_rad = 0.5 * std::atan2(sine, cosine);
  return look;
}

std::optional<cv::Point2f> refine_saddle(const cv::Mat& grey, cv::Point2f place, int half_window_px,
                                         double reach_px) {
  if (!inside(grey, place, half_window_px + 2.0)) return std::nullopt;
  std::vector<cv::Point2f> refined = {place};
  cv::cornerSubPix(grey, refined, {half_window_px, half_window_px}, {-1, -1},
                   {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 40, 1e-3});
  if (cv::norm(refined[0] - place) > reach_px) return std::nullopt;
  return refined[0];
}

std::vector<Saddle> find_saddles(const cv::Mat& grey, std::size_t most) {
  const cv::Mat strength = saddle_strength(grey);
  cv::Mat largest;
  cv::dilate(strength, largest, cv::Mat::ones(7, 7, CV_8U));
  double strongest = 0.0;
  cv::minMaxLoc(strength, nullptr, &strongest);
  struct Peak {
    float strength;
    cv::Point2f place;
  };
  std::vector<Peak> peaks;
  const auto least = static_cast<float>(0.005 * strongest);
  for (int y = 1; y + 1 < grey.rows; ++y) {
    const float* row = strength.ptr<float>(y);
    const float* around = largest.ptr<float>(y);
    for (int x = 1; x + 1 < grey.cols; ++x) {
      if (row[x] > least && row[x] == around[x]) {
        peaks.push_back({row[x], cv::Point2f(static_cast<float>(x), static_cast<float>(y))});
      }
    }
  }
  std::stable_sort(peaks.begin(), peaks.end(),
                   [](const Peak& a, const Peak& b) { return a.strength > b.strength; });
  std::vector<Saddle> saddles;
  for (const Peak& peak : peaks) {
    if (saddles.size() == most) break;
    if (!look_at_saddle(grey, peak.place, kRadius)) continue;
    const auto place = refine_saddle(grey, peak.place, kHalfWindow, 3.0);
    if (!place) continue;
    const auto look = look_at_saddle(grey, *place, kRadius);
    const bool known = std::any_of(saddles.begin(), saddles.end(), [&](const Saddle& s) {
      return cv::norm(s.place - *place) < 2.0;
    });
    if (look && !known) saddles.push_back({*place, *look});
  }
  return saddles;
}

}  // namespace semblance
