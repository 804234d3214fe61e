// Identity of the built-in face: measures named as in anthropometry, and how they move the sweep.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace semblance::face {

struct Place;

/// One coefficient per entry of identity_measures(), in millimetres of displacement.
using Identity = Eigen::VectorXd;

/// A point on the left half of the skin, by column and row coordinate.
struct SkinPoint {
  double column = 0.0, row = 0.0;
};

/// What a measure is taken between.
enum class MeasureKind {
  none,      // no distance: the parameter is the displacement of its own centre
  breadth,   // from a point to its mirror image
  distance,  // between two points
  height,    // their difference in y
  eyes,      // between the eyeballs' centres
  ear        // from the top to the lowest point of the ear
};

struct IdentityMeasure {
  const char* name;
  double mean_mm, deviation_mm;  // mean 0: as the contours have it
  MeasureKind kind;
  SkinPoint a, b;
  const char* doc;
};
const std::vector<IdentityMeasure>& identity_measures();

/// Displacement of a point of the neutral sweep (left half) for coefficients `c`.
Eigen::Vector3d identity_displacement(const Place& place, const Eigen::Vector3d& point,
                                      const Identity& c);

}  // namespace semblance::face
