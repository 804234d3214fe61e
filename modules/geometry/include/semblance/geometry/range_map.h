// Range maps: the radius of a surface over angle and height, as a cylindrical digitizer records it.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>

#include "semblance/core/mesh.h"
#include "semblance/core/rigid3.h"

namespace semblance {

/// Values over rows (heights, upward) and columns (angles), row by row: a row is a contour.
using Grid = Eigen::Array<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// What a sample of a range map is worth. A void one has no radius.
enum class RangeSample : std::uint8_t { none = 0, measured = 1, filled = 2 };

/// Radii over height and angle, the grid of Moubaraki, Tanaka and Kitamura, ATR TR-C-0089 (1993),
/// section 3.2.1. In the map's frame the axis is y, row i lies at height bottom_m + i * spacing_m,
/// and column j looks from the axis along (sin a, 0, cos a) with a = column_angle_rad(j): z is in
/// the middle of the map and its seam behind.
struct RangeMap {
  using Samples = Eigen::Array<RangeSample, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  Grid radius_m;    // positive; 0 where there is none
  Samples samples;  // of the same size
  double bottom_m = 0.0, spacing_m = 0.0;
  Rigid3 world_from_map;

  Eigen::Index rows() const { return radius_m.rows(); }
  Eigen::Index columns() const { return radius_m.cols(); }
  double height_m(Eigen::Index row) const {
    return bottom_m + spacing_m * static_cast<double>(row);
  }
  /// In (-pi, pi).
  double column_angle_rad(Eigen::Index column) const;
  /// A surface point in the world.
  Eigen::Vector3d point(Eigen::Index row, Eigen::Index column) const;
};

/// The least and the most rows and columns of a range map.
inline constexpr Eigen::Index fewest_range_rows = 2, fewest_range_columns = 3,
                              most_range_samples_per_side = 8192;

/// Throws InvalidInput, naming `source`, unless sizes agree and are in range, the spacing is
/// positive, every sample that is not void has a finite positive radius, and one is measured.
void validate(const RangeMap& map, const std::string& source);

/// Gives every void sample the radius of the membrane through the measured ones (Laplace's equation
/// on the unrolled cylinder, periodic in the angle, free at top and bottom) and marks it as filled.
/// Throws InvalidInput as `validate` does.
void fill_voids(RangeMap& map);

/// The mean of the measured radii in metres.
double mean_radius_m(const RangeMap& map);

/// Triangles between neighbouring samples, closed around the axis, in the world's frame; none
/// touches a void sample, and those between rows whose radii jump are as steep as the jump.
Mesh mesh_from_range_map(const RangeMap& map);

}  // namespace semblance
