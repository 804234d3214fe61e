// From places on a sheet to places in a picture, by homographies through the nearest points known.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace semblance {

class SheetWarp {
 public:
  void add(const Eigen::Vector2d& sheet, const Eigen::Vector2d& image_px);
  std::size_t size() const { return sheet_.size(); }
  /// Needs four points or more, not all on a line.
  Eigen::Vector2d predict(const Eigen::Vector2d& sheet) const;
  /// Derivative of `predict`.
  Eigen::Matrix2d jacobian(const Eigen::Vector2d& sheet) const;

 private:
  Eigen::Matrix3d local_homography(const Eigen::Vector2d& sheet) const;

  std::vector<Eigen::Vector2d> sheet_, image_px_;
};

/// Homography from a to b by the direct linear transform on normalised coordinates (Hartley 1997).
Eigen::Matrix3d fit_homography(const std::vector<Eigen::Vector2d>& a,
                               const std::vector<Eigen::Vector2d>& b);

}  // namespace semblance
