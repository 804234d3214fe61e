// Lens models: how a direction in the camera frame becomes a point of the image plane.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string_view>

namespace semblance {

/// The image plane is z = 1 of the camera frame: pixels are focal_px * point + principal_px.
///
///   pinhole   no distortion
///   brown2    k1, k2                          radial, even powers
///   brown5    k1, k2, p1, p2, k3              Brown, "Decentering distortion of lenses", 1966
///   brown8    k1, k2, p1, p2, k3, k4, k5, k6  the radial polynomial divided by another
///   fisheye   k1, k2, k3, k4                  theta (1 + k1 theta^2 + ...), Kannala and Brandt,
///                                             "A generic camera model", PAMI 2006, eq. 6
///
/// Coefficients stand in OpenCV's order. To add a lens: a line in the table of lens.cc and a case
/// of `distort`.
enum class Lens { pinhole, brown2, brown5, brown8, fisheye };

/// Room for the coefficients of any lens; those the lens does not have are zero.
using LensCoefficients = std::array<double, 8>;

int coefficient_count(Lens lens);
/// Name of coefficient `index` ("k1").
std::string_view coefficient_name(Lens lens, int index);
/// "pinhole", "brown2", ...
std::string_view lens_name(Lens lens);
std::optional<Lens> lens_from_name(std::string_view name);
/// All lenses, in the order of the enumeration.
inline constexpr std::array all_lenses{Lens::pinhole, Lens::brown2, Lens::brown5, Lens::brown8,
                                       Lens::fisheye};

/// A point on the image plane with its derivatives.
struct LensPoint {
  Eigen::Vector2d point;
  Eigen::Matrix2d d_direction;                 // by the undistorted (x / z, y / z)
  Eigen::Matrix<double, 2, 8> d_coefficients;  // only the lens's own columns mean anything
};

/// Where the direction (x, y, 1) falls.
LensPoint distort(Lens lens, const LensCoefficients& coefficients,
                  const Eigen::Vector2d& direction);

/// The direction (x, y, 1) that falls on `point`, on the branch through the axis; NaN where the
/// lens shows none (beyond the fold of a strong distortion, or 90 degrees of a fisheye).
Eigen::Vector2d undistort(Lens lens, const LensCoefficients& coefficients,
                          const Eigen::Vector2d& point);

}  // namespace semblance
