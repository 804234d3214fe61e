#include "semblance/lips/dots.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "median.h"
#include "semblance/core/errors.h"
#include "semblance/cost/observation.h"

namespace semblance {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3f;

constexpr double kSurround = 1.6;  // ratio of the two Gaussians of a difference
// A disc of radius R answers a difference of Gaussians most where the narrower one has about this
// share of R: the Laplacian's R / sqrt(2) over sqrt(kSurround).
constexpr double kSigmaOfRadius = 0.56;
constexpr float kLeastContrast = 0.02f;  // of a spot, in encoded intensity
// What a flat, evenly lit disc leaves out of a real dot, as a share of its radius.
constexpr double kModelShare = 0.03;
constexpr double kManyPixelsReach = 7.0;  // of a dot's fit, in pixels
constexpr double kRoundness = 0.4;        // least ratio of a spot's two curvatures

cv::Mat view(const Image& image) {
  return {image.height, image.width, CV_32FC(image.channels),
          const_cast<float*>(image.data.data())};
}

cv::Mat blurred(const cv::Mat& in, double sigma_px) {
  cv::Mat out;
  const int half = std::max(1, static_cast<int>(std::ceil(3.0 * sigma_px)));
  cv::GaussianBlur(in, out, {2 * half + 1, 2 * half + 1}, sigma_px, sigma_px, cv::BORDER_REPLICATE);
  return out;
}

cv::Mat encoded(const Image& linear_rgb) {
  cv::Mat out;
  cv::sqrt(cv::max(view(linear_rgb), 0.0), out);
  return out;
}

/// The difference of Gaussians in three channels, and its length.
struct Difference {
  cv::Mat colour, length;
};

Difference difference(const cv::Mat& picture, double sigma_px) {
  Difference d;
  d.colour = blurred(picture, sigma_px) - blurred(picture, kSurround * sigma_px);
  d.length.create(picture.size(), CV_32F);
  for (int y = 0; y < picture.rows; ++y) {
    const auto* in = d.colour.ptr<cv::Vec3f>(y);
    auto* out = d.length.ptr<float>(y);
    for (int x = 0; x < picture.cols; ++x) out[x] = std::sqrt(in[x].dot(in[x]));
  }
  return d;
}

bool is_peak(const cv::Mat& m, int x, int y) {
  const float value = m.at<float>(y, x);
  for (int j = -1; j <= 1; ++j) {
    for (int i = -1; i <= 1; ++i) {
      if ((i != 0 || j != 0) && m.at<float>(y + j, x + i) > value) return false;
    }
  }
  return true;
}

/// Ratio of the smaller to the greater curvature of the difference along its own direction of
/// colour; at most 0 on a saddle.
double roundness(const Difference& d, int x, int y) {
  const cv::Vec3f way = d.colour.at<cv::Vec3f>(y, x);
  const auto at = [&](int i, int j) -> double {
    return d.colour.at<cv::Vec3f>(y + j, x + i).dot(way);
  };
  const double xx = at(1, 0) + at(-1, 0) - 2 * at(0, 0), yy = at(0, 1) + at(0, -1) - 2 * at(0, 0);
  const double xy = 0.25 * (at(1, 1) + at(-1, -1) - at(1, -1) - at(-1, 1));
  const double mean = 0.5 * (xx + yy), split = std::hypot(0.5 * (xx - yy), xy);
  return mean < 0.0 ? (mean + split) / (mean - split) : 0.0;
}

struct Peak {
  Spot spot;
  float strength = 0.0f;
};

void add_peaks(const cv::Mat& picture, double sigma_px, double scale, std::vector<Peak>& peaks) {
  const Difference d = difference(picture, sigma_px);
  for (int y = 1; y + 1 < picture.rows; ++y) {
    const auto* row = d.length.ptr<float>(y);
    for (int x = 1; x + 1 < picture.cols; ++x) {
      if (row[x] < 0.3f * kLeastContrast || !is_peak(d.length, x, y)) continue;
      if (roundness(d, x, y) < kRoundness) continue;
      const cv::Vec3f c = d.colour.at<cv::Vec3f>(y, x);
      Peak peak;
      peak.spot.centre_px = scale * Vector2d(x + 0.5, y + 0.5);
      peak.spot.radius_px = scale * sigma_px / kSigmaOfRadius;
      peak.spot.contrast = Vector3f(c[0], c[1], c[2]);
      peak.strength = row[x];
      peaks.push_back(peak);
    }
  }
}

/// The strongest of those that share a place.
std::vector<Spot> distinct(std::vector<Peak> peaks, int most) {
  std::stable_sort(peaks.begin(), peaks.end(),
                   [](const Peak& a, const Peak& b) { return a.strength > b.strength; });
  std::vector<Spot> spots;
  for (const Peak& peak : peaks) {
    if (static_cast<int>(spots.size()) == most) break;
    const bool taken = std::any_of(spots.begin(), spots.end(), [&](const Spot& other) {
      return (other.centre_px - peak.spot.centre_px).norm() <
             0.8 * std::max(other.radius_px, peak.spot.radius_px);
    });
    if (!taken) spots.push_back(peak.spot);
  }
  return spots;
}

/// Mean and covariance of the encoded colours of some pixels.
struct ColourStatistics {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  double count = 0.0;

  void add(const Eigen::Vector3d& colour) {
    mean += colour;
    covariance += colour * colour.transpose();
    count += 1.0;
  }
  void finish() {
    mean /= std::max(count, 1.0);
    covariance = covariance / std::max(count, 1.0) - mean * mean.transpose();
  }
};

Eigen::Vector3d encoded_at(const Image& linear_rgb, int x, int y) {
  const float* pixel = linear_rgb.pixel(x, y);
  return {encode_intensity(pixel[0]), encode_intensity(pixel[1]), encode_intensity(pixel[2])};
}

/// Around the points, `margin_px` wider, inside the picture.
PixelRect rect_around(const std::vector<Spot>& dots, double margin_px, const Image& picture) {
  Vector2d low = dots.front().centre_px, high = low;
  for (const Spot& dot : dots) {
    low = low.cwiseMin(dot.centre_px);
    high = high.cwiseMax(dot.centre_px);
  }
  const auto clamped = [](double value, int size) {
    return std::clamp(static_cast<int>(std::floor(value)), 0, size);
  };
  PixelRect rect;
  rect.x0 = clamped(low.x() - margin_px, picture.width);
  rect.y0 = clamped(low.y() - margin_px, picture.height);
  rect.width = clamped(high.x() + margin_px, picture.width) - rect.x0;
  rect.height = clamped(high.y() + margin_px, picture.height) - rect.y0;
  return rect;
}

/// Fisher's direction, scaled such that a dot is 1 above its background.
Vector3f discriminant(const Image& linear_rgb, const std::vector<Spot>& dots) {
  double radius = 0.0;
  for (const Spot& dot : dots) radius += dot.radius_px / static_cast<double>(dots.size());
  const PixelRect rect = rect_around(dots, 6.0 * radius, linear_rgb);
  ColourStatistics inside, beside;
  for (int y = rect.y0; y < rect.y0 + rect.height; ++y) {
    for (int x = rect.x0; x < rect.x0 + rect.width; ++x) {
      double nearest = 1e9;
      for (const Spot& dot : dots) {
        nearest = std::min(nearest, (dot.centre_px - Vector2d(x + 0.5, y + 0.5)).norm());
      }
      if (nearest < std::max(0.5 * radius, 0.8)) inside.add(encoded_at(linear_rgb, x, y));
      if (nearest > 1.8 * radius + 1.0) beside.add(encoded_at(linear_rgb, x, y));
    }
  }
  inside.finish();
  beside.finish();
  const Eigen::Vector3d gap = inside.mean - beside.mean;
  const Eigen::Matrix3d scatter = inside.covariance + beside.covariance +
                                  1e-4 * Eigen::Matrix3d::Identity();  // noise of about 2 levels
  const Eigen::Vector3d way = scatter.ldlt().solve(gap);
  const double height = way.dot(gap);
  if (!(height > 1.0) || inside.count < 3.0) {
    throw SolverError("the dots' colour does not differ from that of the lips and the skin");
  }
  return (way / height).cast<float>();
}

// ---- one dot -----------------------------------------------------------------------------------

// Centre x, y, height, background, slope x, y, radius, stretch s, t.
constexpr int kUnknowns = 9;
constexpr double kRadiusSigma = 0.5, kStretchSigma = 0.3;  // of the priors; radius relative
using Unknowns = Eigen::Matrix<double, kUnknowns, 1>;
using Normal = Eigen::Matrix<double, kUnknowns, kUnknowns>;

struct Equations {
  Normal normal = Normal::Zero();
  Unknowns gradient = Unknowns::Zero();
  double cost = 0.0;
  int pixels = 0;
};

/// A pixel's model value and its derivatives.
double evaluate_dot(const Unknowns& u, double edge_px, const Vector2d& p, Unknowns& row) {
  const Vector2d away = p - u.head<2>();
  Eigen::Matrix2d stretch;
  stretch << 1.0 + u[7], u[8], u[8], 1.0 - u[7];
  const Vector2d q = stretch * away;
  const double distance = q.norm(), rim = (distance - u[6]) / edge_px;
  row << -u.segment<2>(4), 0.0, 1.0, away, 0.0, 0.0, 0.0;
  if (rim > 4.5) return u[3] + u.segment<2>(4).dot(away);  // far outside
  const double cover = 0.5 * std::erfc(rim / std::numbers::sqrt2);
  row[2] = cover;
  if (rim > -4.5 && distance > 1e-9) {
    const double steepest = 1.0 / (std::sqrt(2.0 * std::numbers::pi) * edge_px);
    const double fall = u[2] * steepest * std::exp(-0.5 * rim * rim);
    row.head<2>() += fall / distance * (stretch * q);
    row[6] = fall;
    row[7] = -fall / distance * (q.x() * away.x() - q.y() * away.y());
    row[8] = -fall / distance * (q.x() * away.y() + q.y() * away.x());
  }
  return u[3] + u.segment<2>(4).dot(away) + u[2] * cover;
}

/// Squared residuals over the pixels within `reach_px` of `middle_px`; of large dots, over every
/// second one, like the white fields of a chessboard: they have pixels to spare.
Equations compare_dot(const Patch& patch, const Unknowns& u, double edge_px,
                      const Vector2d& middle_px, double reach_px) {
  Equations e;
  const int y0 = std::max(0, static_cast<int>(middle_px.y() - reach_px));
  const int y1 = std::min(patch.image.height - 1, static_cast<int>(middle_px.y() + reach_px));
  const int x0 = std::max(0, static_cast<int>(middle_px.x() - reach_px));
  const int x1 = std::min(patch.image.width - 1, static_cast<int>(middle_px.x() + reach_px));
  const int step = reach_px > kManyPixelsReach ? 2 : 1;
  Unknowns row;
  for (int y = y0; y <= y1; ++y) {
    for (int x = x0 + (step > 1 ? (x0 + y) % 2 : 0); x <= x1; x += step) {
      const Vector2d p(x + 0.5, y + 0.5);
      if ((p - middle_px).squaredNorm() > reach_px * reach_px) continue;
      const double residual = *patch.image.pixel(x, y) - evaluate_dot(u, edge_px, p, row);
      e.normal.selfadjointView<Eigen::Lower>().rankUpdate(row);
      e.gradient += residual * row;
      e.cost += residual * residual;
      ++e.pixels;
    }
  }
  e.normal = Normal(e.normal.selfadjointView<Eigen::Lower>());
  return e;
}

/// Weak pulls of the radius to the look's and of the stretch to zero settle dots of a few pixels.
void add_priors(const Unknowns& u, double radius_px, Equations& e) {
  // Residuals of a good fit are about a twentieth of the height.
  constexpr double kNoise = 0.05;
  const auto pull = [&](int i, double gap, double sigma) {
    const double weight = kNoise * kNoise / (sigma * sigma);
    e.normal(i, i) += weight;
    e.gradient[i] += weight * gap;
    e.cost += weight * gap * gap;
  };
  pull(6, radius_px - u[6], kRadiusSigma * radius_px);
  pull(7, -u[7], kStretchSigma);
  pull(8, -u[8], kStretchSigma);
}

Equations dot_equations(const Patch& patch, const DotLook& look, const Unknowns& u,
                        const Vector2d& middle_px) {
  const double reach_px = 1.15 * look.radius_px + 2.0 * look.edge_px + 1.0;
  Equations e = compare_dot(patch, u, look.edge_px, middle_px, reach_px);
  add_priors(u, look.radius_px, e);
  return e;
}

}  // namespace

std::vector<Spot> find_spots(const Image& linear_rgb, int most) {
  cv::Mat picture = encoded(linear_rgb);
  std::vector<Peak> peaks;
  double scale = 1.0;
  const double largest_px = linear_rgb.width / 25.0;
  while (scale * 0.85 / kSigmaOfRadius < largest_px && std::min(picture.rows, picture.cols) > 8) {
    for (const double sigma_px : {0.85, 1.2}) add_peaks(picture, sigma_px, scale, peaks);
    cv::Mat smaller;
    cv::resize(picture, smaller, {picture.cols / 2, picture.rows / 2}, 0, 0, cv::INTER_AREA);
    picture = smaller;
    scale *= 2.0;
  }
  return distinct(std::move(peaks), most);
}

DotLook learn_look(const Image& linear_rgb, const std::vector<Spot>& dots) {
  DotLook look;
  look.weights = discriminant(linear_rgb, dots);
  std::vector<double> radii;
  for (const Spot& dot : dots) radii.push_back(dot.radius_px);
  look.radius_px = median(radii);
  const Patch patch =
      project_look(linear_rgb, look, rect_around(dots, 6.0 * look.radius_px, linear_rgb));
  // The blur that explains the dots best, together with their radii.
  double least = std::numeric_limits<double>::infinity();
  DotLook best = look;
  for (const double edge_px : {0.5, 0.65, 0.8, 1.0, 1.25, 1.6, 2.0, 2.5}) {
    look.edge_px = edge_px;
    std::vector<double> fitted, residuals;
    for (const Spot& dot : dots) {
      const auto fit = fit_dot(patch, look, dot.centre_px);
      fitted.push_back(fit ? fit->radius_px : look.radius_px);
      residuals.push_back(fit ? fit->residual_rms : 1.0);
    }
    const double residual = median(residuals);
    if (residual >= least) continue;
    least = residual;
    best.edge_px = edge_px;
    best.radius_px = median(fitted);
  }
  if (!(least < 1.0)) throw SolverError("the dots are not round");
  return best;
}

Patch project_look(const Image& linear_rgb, const DotLook& look, const PixelRect& rect) {
  Patch patch;
  PixelRect& r = patch.rect;
  r.x0 = std::clamp(rect.x0, 0, linear_rgb.width);
  r.y0 = std::clamp(rect.y0, 0, linear_rgb.height);
  r.width = std::clamp(rect.x0 + rect.width, r.x0, linear_rgb.width) - r.x0;
  r.height = std::clamp(rect.y0 + rect.height, r.y0, linear_rgb.height) - r.y0;
  patch.image = Image(r.width, r.height, 1);
  if (patch.image.empty()) return patch;
  const cv::Mat part = view(linear_rgb)(cv::Rect(r.x0, r.y0, r.width, r.height));
  cv::Mat roots, out = view(patch.image);
  cv::sqrt(part, roots);
  cv::transform(roots, out, cv::Matx13f(look.weights[0], look.weights[1], look.weights[2]));
  return patch;
}

std::vector<DotCandidate> find_candidates(const Patch& patch, const DotLook& look,
                                          double least_response) {
  std::vector<DotCandidate> found;
  if (patch.image.width < 5 || patch.image.height < 5) return found;
  // Large dots are sought in a reduced picture, so that the time does not depend on their size.
  const double radius_px = std::hypot(look.radius_px, look.edge_px);
  const int shrink = std::max(1, static_cast<int>(radius_px / 3.0));
  cv::Mat picture = view(patch.image);
  if (shrink > 1) {
    cv::Mat smaller;
    cv::resize(picture, smaller,
               {std::max(5, picture.cols / shrink), std::max(5, picture.rows / shrink)}, 0, 0,
               cv::INTER_AREA);
    picture = smaller;
  }
  const Vector2d scale(static_cast<double>(patch.image.width) / picture.cols,
                       static_cast<double>(patch.image.height) / picture.rows);
  const double sigma_px = kSigmaOfRadius * radius_px / scale.x();
  const cv::Mat d = blurred(picture, sigma_px) - blurred(picture, kSurround * sigma_px);
  // What a sharp disc of height 1 gives at its centre.
  const double r2 = std::pow(radius_px / scale.x() / sigma_px, 2);
  const double full = std::exp(-0.5 * r2 / (kSurround * kSurround)) - std::exp(-0.5 * r2);
  for (int y = 1; y + 1 < d.rows; ++y) {
    for (int x = 1; x + 1 < d.cols; ++x) {
      const double response = d.at<float>(y, x) / full;
      if (response < least_response || !is_peak(d, x, y)) continue;
      DotCandidate candidate;
      candidate.centre_px =
          Vector2d(patch.rect.x0, patch.rect.y0) + scale.cwiseProduct(Vector2d(x + 0.5, y + 0.5));
      candidate.response = response;
      found.push_back(candidate);
    }
  }
  std::stable_sort(found.begin(), found.end(), [](const DotCandidate& a, const DotCandidate& b) {
    return a.response > b.response;
  });
  return found;
}

std::optional<DotFit> fit_dot(const Patch& patch, const DotLook& look,
                              const Eigen::Vector2d& start_px) {
  constexpr int kSteps = 12;
  const Vector2d origin(patch.rect.x0, patch.rect.y0), start = start_px - origin;
  const int x = static_cast<int>(start.x()), y = static_cast<int>(start.y());
  if (!(start.minCoeff() >= 0.0) || x >= patch.image.width || y >= patch.image.height) return {};
  Unknowns u;
  u << start, 1.0, *patch.image.pixel(x, y) - 1.0, 0.0, 0.0, look.radius_px, 0.0, 0.0;
  double damping = 1e-3;
  Vector2d middle = start;
  Equations e = dot_equations(patch, look, u, middle);
  for (int step = 0; step < kSteps && damping < 1e6; ++step) {
    Normal damped = e.normal;
    damped.diagonal() *= 1.0 + damping;
    const Unknowns change = damped.ldlt().solve(e.gradient), next = u + change;
    const Equations there = dot_equations(patch, look, next, middle);
    if (!(there.cost < e.cost)) {
      damping *= 10.0;
      continue;
    }
    u = next;
    e = there;
    damping *= 0.2;
    if ((u.head<2>() - middle).norm() > 0.7) {  // the window follows the dot
      middle = u.head<2>();
      e = dot_equations(patch, look, u, middle);
    }
    if (change.head<2>().norm() < 2e-3) break;
  }
  const double radius_px = look.radius_px;
  const bool near = (u.head<2>() - start).norm() < 1.0 + radius_px;
  if (!u.allFinite() || !near || e.pixels < 2 * kUnknowns) return {};
  if (u[2] < 0.35 || u[2] > 2.0 || u[6] < 0.5 * radius_px || u[6] > 1.7 * radius_px) return {};
  if (u.tail<2>().norm() > 0.6) return {};
  const double variance = e.cost / (e.pixels - kUnknowns);
  const Normal covariance = variance * e.normal.inverse();
  DotFit fit;
  fit.centre_px = origin + u.head<2>();
  const double model_px = kModelShare * u[6];
  fit.sigma_px = (covariance.diagonal().head<2>().array().max(0.0) + model_px * model_px).sqrt();
  fit.height = u[2];
  fit.radius_px = u[6];
  fit.residual_rms = std::sqrt(variance) / u[2];
  return fit;
}

}  // namespace semblance
