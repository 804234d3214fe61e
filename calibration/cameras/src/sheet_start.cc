#include "sheet_start.h"

#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>

namespace semblance {
namespace {

std::vector<cv::Point2d> cv_points(const Eigen::Matrix2Xd& points) {
  std::vector<cv::Point2d> result;
  for (const auto& point : points.colwise()) result.emplace_back(point.x(), point.y());
  return result;
}

// Flat points are spread over two directions; the lesser's share of the greater.
double flatness(const Eigen::Matrix2Xd& points) {
  const Eigen::Matrix2Xd centred = points.colwise() - points.rowwise().mean();
  const Eigen::Matrix2d spread = centred * centred.transpose();
  const double half_trace = 0.5 * spread.trace();
  const double root = std::sqrt(std::max(half_trace * half_trace - spread.determinant(), 0.0));
  return std::sqrt(std::max(half_trace - root, 0.0) / (half_trace + root));
}

constexpr double kLine = 1e-4;

std::optional<Eigen::Matrix3d> homography(const SheetView& view) {
  if (view.sheet_m.cols() < 4 || !(flatness(view.sheet_m) > kLine)) return std::nullopt;
  const cv::Mat found = cv::findHomography(cv_points(view.sheet_m), cv_points(view.pixels_px));
  if (found.empty()) return std::nullopt;
  Eigen::Matrix3d result;
  cv::cv2eigen(found, result);
  return result;
}

std::optional<SheetView> undistorted(const Camera& camera, const SheetView& view) {
  SheetView result = view;
  for (Eigen::Index i = 0; i < view.pixels_px.cols(); ++i) {
    result.pixels_px.col(i) = unproject(camera, view.pixels_px.col(i)).head<2>();
  }
  if (!result.pixels_px.allFinite()) return std::nullopt;
  return result;
}

}  // namespace

std::optional<double> focal_from_sheets(const std::vector<SheetView>& views,
                                        const Eigen::Vector2d& principal_px) {
  // With w = 1 / f^2: h1' diag(w, w, 1) h2 = 0 and h1' diag(w, w, 1) h1 = h2' diag(w, w, 1) h2.
  double above = 0.0, below = 0.0;
  for (const SheetView& view : views) {
    SheetView centred = view;
    centred.pixels_px.colwise() -= principal_px;
    std::optional<Eigen::Matrix3d> h = homography(centred);
    if (!h) continue;
    *h /= h->leftCols<2>().norm();
    const Eigen::Vector3d sum = h->col(0) + h->col(1), difference = h->col(0) - h->col(1);
    const auto add = [&](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
      const double plane = a.head<2>().dot(b.head<2>()), depth = a.z() * b.z();
      above -= plane * depth;
      below += plane * plane;
    };
    add(h->col(0), h->col(1));
    add(sum, difference);
  }
  const double w = above / below;
  if (!(w > 0.0) || !std::isfinite(w)) return std::nullopt;
  return 1.0 / std::sqrt(w);
}

std::optional<Rigid3> sheet_pose(const Camera& camera, const SheetView& view) {
  if (view.sheet_m.cols() < 4 || !(flatness(view.sheet_m) > kLine)) return std::nullopt;
  const std::optional<SheetView> seen = undistorted(camera, view);
  if (!seen) return std::nullopt;
  std::vector<cv::Point3d> points;
  for (const auto& point : view.sheet_m.colwise()) points.emplace_back(point.x(), point.y(), 0.0);
  std::vector<cv::Mat> turns, shifts;
  cv::solvePnPGeneric(points, cv_points(seen->pixels_px), cv::Matx33d::eye(), cv::noArray(), turns,
                      shifts, false, cv::SOLVEPNP_IPPE);
  std::optional<Rigid3> best;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < turns.size(); ++i) {
    Eigen::Vector3d turn, shift;
    cv::cv2eigen(turns[i], turn);
    cv::cv2eigen(shifts[i], shift);
    const Rigid3 pose{quaternion_from_rotation_vector(turn), shift};
    const double error_px = sheet_error_px(camera, pose, view);
    if (!(error_px < least)) continue;
    least = error_px;
    best = pose;
  }
  return best;
}

double sheet_error_px(const Camera& camera, const Rigid3& camera_from_sheet,
                      const SheetView& view) {
  double sum = 0.0;
  for (Eigen::Index i = 0; i < view.sheet_m.cols(); ++i) {
    const Eigen::Vector3d point =
        camera_from_sheet * Eigen::Vector3d(view.sheet_m(0, i), view.sheet_m(1, i), 0.0);
    if (!(point.z() > 0.0)) return std::numeric_limits<double>::infinity();
    sum += (project(camera, point) - view.pixels_px.col(i)).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(view.sheet_m.cols()));
}

}  // namespace semblance
