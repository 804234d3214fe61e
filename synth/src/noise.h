// Lattice noise for procedural colours.
#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace semblance {

/// Uniform number in [0, 1) of a lattice cell.
float cell_value(int x, int y, int z, std::uint32_t seed);

/// Smooth noise of unit lattice spacing, mean about 0, within [-1, 1] (Perlin 2002: gradients on
/// the lattice, quintic interpolation).
float gradient_noise(const Eigen::Vector3f& p, std::uint32_t seed);

/// Sum of `octaves` of gradient_noise, each half as large and twice as fine as the one before.
float fractal_noise(const Eigen::Vector3f& p, int octaves, std::uint32_t seed);

/// Hermite step from 0 at `edge0` to 1 at `edge1`.
float smooth_step(float edge0, float edge1, float x);

}  // namespace semblance
