#include "semblance/cameras/dots.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "ellipses.h"
#include "semblance/core/conventions.h"

namespace semblance {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kLeastSide = 16;  // px

void add_dots(const cv::Mat& grey, bool light, const DotOptions& options, std::vector<Dot>& dots) {
  cv::Mat dark;
  if (light) cv::bitwise_not(grey, dark);
  const cv::Mat& picture = light ? dark : grey;
  for (const Ellipse& e : find_ellipses(picture)) {
    const Matrix2d covariance = centre_covariance(picture, e);
    const double worst = Eigen::SelfAdjointEigenSolver<Matrix2d>(covariance).eigenvalues()[1];
    if (!(worst <= options.most_sigma_px * options.most_sigma_px)) continue;
    dots.push_back({ours_from_integer_centred(e.centre_px), e.major_px, e.minor_px, e.angle_rad,
                    covariance, light});
  }
}

/// Of dots that lie in each other the most certain one.
std::vector<Dot> each_once(std::vector<Dot> dots) {
  std::stable_sort(dots.begin(), dots.end(), [](const Dot& a, const Dot& b) {
    return a.covariance_px2.trace() < b.covariance_px2.trace();
  });
  std::vector<Dot> result;
  for (const Dot& dot : dots) {
    const bool known = std::any_of(result.begin(), result.end(), [&](const Dot& other) {
      return (other.centre_px - dot.centre_px).norm() <
             0.5 * std::max(other.minor_px, dot.minor_px);
    });
    if (!known) result.push_back(dot);
  }
  std::sort(result.begin(), result.end(), [](const Dot& a, const Dot& b) {
    return std::pair(a.centre_px.y(), a.centre_px.x()) <
           std::pair(b.centre_px.y(), b.centre_px.x());
  });
  return result;
}

bool has_colour(const std::array<cv::Mat, 3>& channels) {
  constexpr double grey_difference = 2.0;  // mean, grey levels
  const double pixels = static_cast<double>(channels[0].total());
  return cv::norm(channels[0], channels[1], cv::NORM_L1) / pixels > grey_difference ||
         cv::norm(channels[2], channels[1], cv::NORM_L1) / pixels > grey_difference;
}

/// Half axes of the outline on the image plane z = 1: columns of a matrix.
struct PlaneEllipse {
  Vector2d centre;
  Matrix2d axes;
};

PlaneEllipse ellipse_of(const Disc& disc) {
  // A disc's dual conic is r^2 (I - n n') - c c', projected by dropping nothing: the camera's
  // matrix is the identity.
  const Vector3d& c = disc.centre_m;
  const Vector3d n = disc.normal.normalized();
  const Eigen::Matrix3d dual =
      disc.radius_m * disc.radius_m * (Eigen::Matrix3d::Identity() - n * n.transpose()) -
      c * c.transpose();
  const Vector2d centre = dual.topRightCorner<2, 1>() / dual(2, 2);
  const Matrix2d shape = centre * centre.transpose() - dual.topLeftCorner<2, 2>() / dual(2, 2);
  const Eigen::SelfAdjointEigenSolver<Matrix2d> solver(shape);
  const Vector2d lengths = solver.eigenvalues().cwiseMax(0.0).cwiseSqrt();
  return {centre, solver.eigenvectors() * lengths.asDiagonal()};
}

}  // namespace

double Dot::radius_px() const { return std::sqrt(major_px * minor_px); }

std::vector<Dot> find_dots(const Rgb8& image, const DotOptions& options) {
  if (std::min(image.width, image.height) < kLeastSide) return {};
  const cv::Mat rgb(image.height, image.width, CV_8UC3,
                    const_cast<std::uint8_t*>(image.data.data()));
  std::array<cv::Mat, 3> channels;
  cv::split(rgb, channels.data());
  std::vector<cv::Mat> pictures(1);
  cv::cvtColor(rgb, pictures[0], cv::COLOR_RGB2GRAY);
  if (has_colour(channels)) pictures.insert(pictures.end(), channels.begin(), channels.end());
  std::vector<Dot> dots;
  for (const cv::Mat& picture : pictures) {
    if (options.tone != DotTone::light) add_dots(picture, false, options, dots);
    if (options.tone != DotTone::dark) add_dots(picture, true, options, dots);
  }
  return each_once(std::move(dots));
}

DiscImage image_of(const Camera& camera, const Disc& disc_camera) {
  const PlaneEllipse ellipse = ellipse_of(disc_camera);
  constexpr int corners = 24;
  // Area and centroid of the polygon through points that are even on the ellipse; for an ellipse
  // its centroid is the centre.
  const Vector2d middle = project(camera, ellipse.centre.homogeneous());
  double area = 0.0;
  Vector2d moment = Vector2d::Zero();
  const auto corner = [&](int k) -> Vector2d {
    const double angle = 2.0 * std::numbers::pi * k / corners;
    const Vector2d at = ellipse.centre + ellipse.axes * Vector2d(std::cos(angle), std::sin(angle));
    return project(camera, at.homogeneous()) - middle;
  };
  for (int k = 0; k < corners; ++k) {
    const Vector2d a = corner(k), b = corner(k + 1);
    const double twice = a.x() * b.y() - a.y() * b.x();
    area += 0.5 * twice;
    moment += twice * (a + b) / 6.0;
  }
  const double whole =  // of the ellipse that the polygon is inscribed in
      std::abs(area) * 2.0 * std::numbers::pi /
      (corners * std::sin(2.0 * std::numbers::pi / corners));
  if (area == 0.0) return {middle, 0.0};
  return {middle + moment / area, std::sqrt(whole / std::numbers::pi)};
}

Vector2d centre_offset_px(const Camera& camera, const Disc& disc_camera) {
  return image_of(camera, disc_camera).centre_px - project(camera, disc_camera.centre_m);
}

}  // namespace semblance
