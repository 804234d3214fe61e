#include "saddles.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
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
  cv::GaussianBlur(smooth, smooth, {}, 2.0);
  cv::Sobel(smooth, xx, CV_32F, 2, 0);
  cv::Sobel(smooth, yy, CV_32F, 0, 2);
  cv::Sobel(smooth, xy, CV_32F, 1, 1);
  cv::Mat strength = xy.mul(xy) - xx.mul(yy);
  cv::max(strength, 0.0, strength);
  return strength;
}

/// m + a erf(d1 / s) erf(d2 / s), d1 and d2 the distances from two lines through a point: what blur
/// of sqrt(1/2) s makes of four fields.
class SaddleModel {
 public:
  using Vector = Eigen::Matrix<double, 7, 1>;  // x, y, directions of the lines, m, a, s

  SaddleModel(const cv::Mat& grey, cv::Point2f place, double radius_px)
      : grey_(grey), place_(place), radius_px_(radius_px) {}

  Vector start(const SaddleLook& look) const {
    const double level = grey_at(grey_, place_.x, place_.y);
    Vector x;
    x << place_.x, place_.y, look.edges_rad[0], look.edges_rad[1], level, 0.5 * look.contrast,
        std::max(1.0, 0.3 * radius_px_);
    // The sign of the contrast: the product of both distances in a bright field.
    const double in_bright = std::sin(look.bright_rad - x[2]) * std::sin(look.bright_rad - x[3]);
    if (in_bright < 0.0) x[5] = -x[5];
    return x;
  }

  /// Squared residuals, and the normal equations where they are wanted.
  double evaluate(const Vector& x, Eigen::Matrix<double, 7, 7>* normal, Vector* right) const {
    const double s = x[6];
    const double c1 = std::cos(x[2]), s1 = std::sin(x[2]), c2 = std::cos(x[3]), s2 = std::sin(x[3]);
    double cost = 0.0;
    const int reach = static_cast<int>(std::ceil(radius_px_));
    const int mid_x = cvRound(place_.x), mid_y = cvRound(place_.y);
    for (int py = mid_y - reach; py <= mid_y + reach; ++py) {
      const auto* row = grey_.ptr<std::uint8_t>(py);
      for (int px = mid_x - reach; px <= mid_x + reach; ++px) {
        if (std::hypot(px - place_.x, py - place_.y) > radius_px_) continue;
        const double dx = px - x[0], dy = py - x[1];
        const double d1 = c1 * dy - s1 * dx, d2 = c2 * dy - s2 * dx;
        const double e1 = std::erf(d1 / s), e2 = std::erf(d2 / s);
        const double residual = x[4] + x[5] * e1 * e2 - row[px];
        cost += residual * residual;
        if (!normal) continue;
        const double scale = 2.0 * std::numbers::inv_sqrtpi / s;
        const double g1 = x[5] * e2 * scale * std::exp(-d1 * d1 / (s * s));
        const double g2 = x[5] * e1 * scale * std::exp(-d2 * d2 / (s * s));
        Vector j;
        j << g1 * s1 + g2 * s2, -g1 * c1 - g2 * c2, -g1 * (c1 * dx + s1 * dy),
            -g2 * (c2 * dx + s2 * dy), 1.0, e1 * e2, -(g1 * d1 + g2 * d2) / s;
        *normal += j * j.transpose();
        *right -= j * residual;
      }
    }
    return cost;
  }

  /// Levenberg-Marquardt from x; returns the root mean square residual.
  double solve(Vector& x) const {
    constexpr int kMostSteps = 20;
    double damping = 1e-3;
    double cost = 0.0;
    for (int step = 0; step < kMostSteps && damping < 1e6; ++step) {
      Eigen::Matrix<double, 7, 7> normal = Eigen::Matrix<double, 7, 7>::Zero();
      Vector right = Vector::Zero();
      cost = evaluate(x, &normal, &right);
      normal.diagonal() *= 1.0 + damping;
      const Vector change = normal.ldlt().solve(right);
      Vector next = x + change;
      next[6] = std::clamp(next[6], 0.4, radius_px_);
      if (evaluate(next, nullptr, nullptr) < cost) {
        x = next;
        damping *= 0.1;
        if (change.head<2>().norm() < 1e-3) break;
      } else {
        damping *= 10.0;
      }
    }
    return std::sqrt(cost / (std::numbers::pi * radius_px_ * radius_px_));
  }

 private:
  const cv::Mat& grey_;
  cv::Point2f place_;
  double radius_px_;
};

}  // namespace

std::optional<cv::Point2f> fit_saddle(const cv::Mat& grey, cv::Point2f start,
                                      const SaddleLook& look, double radius_px, double reach_px) {
  constexpr int kMostWindows = 4;
  constexpr double kMostUnexplained = 0.35;  // of the contrast, root mean square
  cv::Point2f place = start;
  for (int window = 0; window < kMostWindows; ++window) {
    if (!inside(grey, place, radius_px + 2.0)) return std::nullopt;
    const SaddleModel model(grey, place, radius_px);
    SaddleModel::Vector x = model.start(look);
    const double rms = model.solve(x);
    const cv::Point2f fitted(static_cast<float>(x[0]), static_cast<float>(x[1]));
    const double moved = cv::norm(fitted - place);
    if (!(cv::norm(fitted - start) < reach_px) || !(moved < radius_px)) return std::nullopt;
    place = fitted;
    if (moved > 0.5) continue;  // the window was not about the place
    const bool clear = std::abs(x[5]) > 0.5 * kLeastContrast &&
                       rms < kMostUnexplained * std::abs(x[5]) &&
                       angle_between_axes(x[2], x[3]) > 0.2;
    // The same fields are bright, and the edges have not changed places.
    const bool same = x[5] * model.start(look)[5] > 0.0 &&
                      angle_between_axes(x[2], look.edges_rad[0]) < 0.5 &&
                      angle_between_axes(x[3], look.edges_rad[1]) < 0.5;
    return clear && same ? std::optional(place) : std::nullopt;
  }
  return std::nullopt;
}

double angle_between_axes(double a_rad, double b_rad) {
  return std::abs(std::remainder(a_rad - b_rad, kPi));
}

std::optional<SaddleLook> look_at_saddle(const cv::Mat& grey, cv::Point2f place, double radius_px) {
  if (!inside(grey, place, radius_px + 1.0)) return std::nullopt;
  std::array<double, kSamples> ring;
  for (int i = 0; i < kSamples; ++i) {
    const double angle = 2.0 * kPi * i / kSamples;
    ring[i] =
        grey_at(grey, place.x + radius_px * std::cos(angle), place.y + radius_px * std::sin(angle));
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

std::vector<Saddle> find_saddles(const cv::Mat& picture, std::size_t most) {
  const cv::Mat strength = saddle_strength(picture);
  cv::Mat grey;  // noise misleads cornerSubPix
  cv::GaussianBlur(picture, grey, {}, 1.0);
  cv::Mat largest;
  cv::dilate(strength, largest, cv::Mat::ones(7, 7, CV_8U));
  double strongest = 0.0;
  cv::minMaxLoc(strength, nullptr, &strongest);
  struct Peak {
    float strength;
    cv::Point2f place;
  };
  std::vector<Peak> peaks;
  const auto least = static_cast<float>(0.02 * strongest);
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
