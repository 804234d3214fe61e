// Sheets for tests and benchmarks of contact.
#pragma once

#include <cmath>

#include "semblance/cloth/contact.h"
#include "semblance/core/random.h"

namespace semblance::testing {

/// Flat square grid in the plane y = 0 about the origin, each square split in two along one
/// diagonal or, in a checker pattern, the other.
inline ContactSurface make_sheet(int columns, int rows, double spacing_m) {
  ContactSurface sheet;
  sheet.rest_positions_m.resize(columns * rows, 3);
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i)
      sheet.rest_positions_m.row(j * columns + i) << spacing_m * (i - 0.5 * (columns - 1)), 0.0,
          spacing_m * (j - 0.5 * (rows - 1));
  sheet.triangles.resize(2 * (columns - 1) * (rows - 1), 3);
  Eigen::Index t = 0;
  for (int j = 0; j + 1 < rows; ++j) {
    for (int i = 0; i + 1 < columns; ++i) {
      const int a = j * columns + i, b = a + 1, c = a + columns, d = c + 1;
      if ((i + j) % 2 == 0) {
        sheet.triangles.row(t++) << a, c, d;
        sheet.triangles.row(t++) << a, d, b;
      } else {
        sheet.triangles.row(t++) << a, c, b;
        sheet.triangles.row(t++) << b, c, d;
      }
    }
  }
  return sheet;
}

/// The sheet bent by waves of random directions, lengths from `shortest_m` and that total height.
inline Points crumpled(const Points& flat, double height_m, double shortest_m, int seed) {
  Random random(seed);
  Points x = flat;
  constexpr int waves = 12;
  for (int w = 0; w < waves; ++w) {
    const double angle = random.uniform(0.0, 2.0 * M_PI), phase = random.uniform(0.0, 2.0 * M_PI);
    const double k = 2.0 * M_PI / (shortest_m * random.uniform(1.0, 4.0));
    const Eigen::Vector3d push(random.normal(), random.normal(), random.normal());
    for (Eigen::Index v = 0; v < x.rows(); ++v)
      x.row(v) +=
          height_m / std::sqrt(waves) *
          std::sin(k * (flat(v, 0) * std::cos(angle) + flat(v, 2) * std::sin(angle)) + phase) *
          push.transpose();
  }
  return x;
}

/// The sheet rolled up about z, without stretch: layers are `pitch_m` apart, the innermost has the
/// radius `inner_m`.
inline Points rolled(const Points& flat, double pitch_m, double inner_m) {
  Points x = flat;
  const double first = flat.col(0).minCoeff(), rate = pitch_m / (2.0 * M_PI);
  for (Eigen::Index v = 0; v < x.rows(); ++v) {
    // Length along the spiral r = inner + rate a is inner a + rate a^2 / 2, but for a part of
    // rate^2.
    const double length = flat(v, 0) - first;
    const double a = (std::sqrt(inner_m * inner_m + 2.0 * rate * length) - inner_m) / rate;
    const double radius = inner_m + rate * a;
    x.row(v) << radius * std::cos(a), radius * std::sin(a), flat(v, 2);
  }
  return x;
}

inline Points noise(Eigen::Index rows, double size_m, int seed) {
  Random random(seed);
  Points x(rows, 3);
  for (Eigen::Index v = 0; v < rows; ++v)
    for (int k = 0; k < 3; ++k) x(v, k) = size_m * random.normal();
  return x;
}

}  // namespace semblance::testing
