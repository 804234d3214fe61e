#include "ellipses.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <opencv2/imgproc.hpp>

namespace semblance {

namespace {

using Eigen::Vector2d;

constexpr double kLeastRadius = 2.5;
constexpr double kLeastAxisRatio = 0.2;
constexpr double kRounding = 0.29;  // its deviation, grey levels

bool plausible(const Ellipse& e) {
  return std::isfinite(e.major_px) && e.radius_px() >= kLeastRadius &&
         e.minor_px >= kLeastAxisRatio * e.major_px;
}

/// The ellipse through a contour where the contour is one.
std::optional<Ellipse> ellipse_of(const std::vector<cv::Point>& contour, const cv::Size& size) {
  if (contour.size() < 8) return std::nullopt;
  const cv::Rect box = cv::boundingRect(contour);
  if (box.width > size.width / 3 || box.height > size.height / 3) return std::nullopt;
  if (box.x <= 1 || box.y <= 1 || box.br().x >= size.width - 1 || box.br().y >= size.height - 1) {
    return std::nullopt;
  }
  const cv::RotatedRect fit = cv::fitEllipse(contour);
  Ellipse e{{fit.center.x, fit.center.y},
            0.5 * fit.size.height,
            0.5 * fit.size.width,
            (fit.angle + 90.0) * std::numbers::pi / 180.0};
  if (e.major_px < e.minor_px) {
    std::swap(e.major_px, e.minor_px);
    e.angle_rad -= std::numbers::pi / 2;
  }
  if (!plausible(e)) return std::nullopt;
  // The contour runs through the outermost pixels' centres, half a pixel inside the outline.
  const double area = std::numbers::pi * e.major_px * e.minor_px;
  const double perimeter = 2.0 * std::numbers::pi * e.radius_px();
  if (std::abs(cv::contourArea(contour) - area) > 0.1 * area + 0.3 * perimeter) return std::nullopt;
  const double c = std::cos(e.angle_rad), s = std::sin(e.angle_rad);
  for (const cv::Point& p : contour) {
    const Vector2d d = Vector2d(p.x, p.y) - e.centre_px;
    const double r =
        std::hypot((c * d.x() + s * d.y()) / e.major_px, (c * d.y() - s * d.x()) / e.minor_px);
    if (std::abs(r - 1.0) * e.minor_px > 1.0 + 0.1 * e.minor_px) return std::nullopt;
  }
  return e;
}

/// The ellipse whose dual conic has these entries (of a symmetric matrix with lower right entry 1).
std::optional<Ellipse> ellipse_of_dual(const Eigen::Matrix<double, 5, 1>& dual) {
  // For centre m and shape S (points x with (x-m)' S^-1 (x-m) = 1) the dual is m m' - S, up to
  // sign.
  const Vector2d centre(dual[3] / 2.0, dual[4] / 2.0);
  Eigen::Matrix2d shape;
  shape << dual[0], dual[1] / 2.0, dual[1] / 2.0, dual[2];
  shape = centre * centre.transpose() - shape;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(shape);
  if (solver.eigenvalues()[0] <= 0.0) return std::nullopt;
  const Vector2d axis = solver.eigenvectors().col(1);
  return Ellipse{centre, std::sqrt(solver.eigenvalues()[1]), std::sqrt(solver.eigenvalues()[0]),
                 std::atan2(axis.y(), axis.x())};
}

using Vector5d = Eigen::Matrix<double, 5, 1>;
using Matrix5d = Eigen::Matrix<double, 5, 5>;

/// The line through a pixel across its gradient, n . d + w = 0, with d from the start's centre in
/// parts of its major axis: it touches the ellipse.
struct TouchingLine {
  int x = 0, y = 0;
  Vector2d place;        // d of the pixel
  Eigen::Vector3d line;  // n (the gradient) and w

  /// The row of the linear equation row . dual = -w^2 for the dual conic.
  Vector5d row() const {
    const double a = line[0], b = line[1], w = line[2];
    Vector5d result;
    result << a * a, a * b, b * b, a * w, b * w;
    return result;
  }
};

/// Lines of the pixels around an outline whose gradient points outwards: a dot is darker than its
/// ground.
std::vector<TouchingLine> touching_lines(const cv::Mat& grey, const Ellipse& start) {
  const double reach = std::max(1.35 * start.major_px, start.major_px + 2.0);
  const auto clipped = [](double value, int size) {
    return std::clamp(static_cast<int>(std::lround(value)), 1, size - 1);
  };
  const int x0 = clipped(start.centre_px.x() - reach, grey.cols);
  const int x1 = clipped(start.centre_px.x() + reach + 1.0, grey.cols);
  const int y0 = clipped(start.centre_px.y() - reach, grey.rows);
  const int y1 = clipped(start.centre_px.y() + reach + 1.0, grey.rows);
  const double c = std::cos(start.angle_rad), s = std::sin(start.angle_rad);
  const double inner = std::max(0.0, std::min(0.65, 1.0 - 2.0 / start.minor_px));
  const double outer = std::max(1.35, 1.0 + 2.0 / start.minor_px);
  const double scale = start.major_px;
  std::vector<TouchingLine> lines;
  for (int y = y0; y < y1; ++y) {
    const auto* above = grey.ptr<std::uint8_t>(y - 1);
    const auto* here = grey.ptr<std::uint8_t>(y);
    const auto* below = grey.ptr<std::uint8_t>(y + 1);
    for (int x = x0; x < x1; ++x) {
      const Vector2d d = (Vector2d(x, y) - start.centre_px) / scale;
      const double r = std::hypot((c * d.x() + s * d.y()) * scale / start.major_px,
                                  (c * d.y() - s * d.x()) * scale / start.minor_px);
      if (r < inner || r > outer) continue;
      const Vector2d gradient(here[x + 1] - here[x - 1], below[x] - above[x]);
      const double w = -gradient.dot(d);
      if (w < 0.0) lines.push_back({x, y, d, {gradient.x(), gradient.y(), w}});
    }
  }
  return lines;
}

struct DualFit {
  Matrix5d normal = Matrix5d::Zero();
  Vector5d dual = Vector5d::Zero();
};

DualFit fit_dual(const std::vector<TouchingLine>& lines) {
  DualFit fit;
  Vector5d right = Vector5d::Zero();
  for (const TouchingLine& touching : lines) {
    const Vector5d row = touching.row();
    fit.normal += row * row.transpose();
    right -= row * (touching.line[2] * touching.line[2]);
  }
  fit.dual = fit.normal.ldlt().solve(right);
  return fit;
}

}  // namespace

double Ellipse::radius_px() const { return std::sqrt(major_px * minor_px); }

std::optional<Ellipse> refine_ellipse(const cv::Mat& grey, const Ellipse& start) {
  const auto fit = ellipse_of_dual(fit_dual(touching_lines(grey, start)).dual);
  if (!fit) return std::nullopt;
  const double scale = start.major_px;
  Ellipse result = *fit;
  result.centre_px = start.centre_px + scale * fit->centre_px;
  result.major_px *= scale;
  result.minor_px *= scale;
  if (!plausible(result) || (result.centre_px - start.centre_px).norm() > 0.3 * start.minor_px) {
    return std::nullopt;
  }
  return result;
}

Eigen::Matrix2d centre_covariance(const cv::Mat& grey, const Ellipse& refined) {
  const std::vector<TouchingLine> lines = touching_lines(grey, refined);
  const DualFit fit = fit_dual(lines);
  Eigen::Matrix3d conic;
  conic << fit.dual[0], fit.dual[1] / 2.0, fit.dual[3] / 2.0,  //
      fit.dual[1] / 2.0, fit.dual[2], fit.dual[4] / 2.0,       //
      fit.dual[3] / 2.0, fit.dual[4] / 2.0, 1.0;
  // Derivative of the normal equations' right side by each pixel's grey level; a pixel belongs to
  // the gradients of its four neighbours.
  std::map<std::pair<int, int>, Vector5d> by_pixel;
  double squares = 0.0, expected = 0.0;
  const auto add = [&](int x, int y, const Vector5d& value) {
    by_pixel.try_emplace({y, x}, Vector5d::Zero()).first->second += value;
  };
  for (const TouchingLine& touching : lines) {
    const Eigen::Vector3d slope = 2.0 * (conic * touching.line);
    const Vector2d by_gradient = slope.head<2>() - slope[2] * touching.place;
    const double residual = 0.5 * touching.line.dot(slope);
    squares += residual * residual;
    expected += 2.0 * by_gradient.squaredNorm();  // for noise of one grey level
    const Vector5d row = touching.row();
    add(touching.x + 1, touching.y, row * by_gradient.x());
    add(touching.x - 1, touching.y, -row * by_gradient.x());
    add(touching.x, touching.y + 1, row * by_gradient.y());
    add(touching.x, touching.y - 1, -row * by_gradient.y());
  }
  Matrix5d spread = Matrix5d::Zero();
  for (const auto& [pixel, value] : by_pixel) spread += value * value.transpose();
  const Matrix5d inverse = fit.normal.ldlt().solve(Matrix5d::Identity());
  const double noise2 = std::max(squares / std::max(expected, 1e-12), kRounding * kRounding);
  const double half = refined.major_px / 2.0;  // the centre is half of the dual's last entries
  return noise2 * half * half * (inverse * spread * inverse).bottomRightCorner<2, 2>();
}

std::vector<Ellipse> find_ellipses(const cv::Mat& grey) {
  std::vector<Ellipse> found;
  const int longest = std::max(grey.cols, grey.rows);
  for (const int share : {12, 40}) {
    cv::Mat dark;
    cv::adaptiveThreshold(grey, dark, 255, cv::ADAPTIVE_THRESH_MEAN_C, cv::THRESH_BINARY_INV,
                          std::max(11, (longest / share) | 1), 10);
    std::vector<std::vector<cv::Point>> contours;
    // Components at any depth: a dark ground that surrounds a light object must not hide its dots.
    std::vector<cv::Vec4i> tree;
    cv::findContours(dark, contours, tree, cv::RETR_CCOMP, cv::CHAIN_APPROX_NONE);
    for (std::size_t i = 0; i < contours.size(); ++i) {
      if (tree[i][3] >= 0) continue;  // a hole
      const auto rough = ellipse_of(contours[i], grey.size());
      if (!rough) continue;
      const bool known = std::any_of(found.begin(), found.end(), [&](const Ellipse& e) {
        return (e.centre_px - rough->centre_px).norm() < 0.5 * e.minor_px;
      });
      if (known) continue;
      if (const auto refined = refine_ellipse(grey, *rough)) found.push_back(*refined);
    }
  }
  return found;
}

}  // namespace semblance
