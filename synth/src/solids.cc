#include "solids.h"

#include <Eigen/Geometry>

#include <cmath>
#include <numbers>

namespace semblance {
namespace {

using Eigen::Vector3d;

void append(const Mesh& part, Mesh& whole) {
  const Eigen::Index vertices = whole.vertex_count(), triangles = whole.triangle_count();
  whole.positions_m.conservativeResize(vertices + part.vertex_count(), 3);
  whole.triangles.conservativeResize(triangles + part.triangle_count(), 3);
  whole.positions_m.bottomRows(part.vertex_count()) = part.positions_m;
  whole.triangles.bottomRows(part.triangle_count()) =
      part.triangles.array() + static_cast<int>(vertices);
}

// A sphere of radius 1 stretched: points on the upper half move to `to`, on the lower to `from`.
Mesh capsule(const Vector3d& from, const Vector3d& to, double radius_from, double radius_to) {
  constexpr int kAround = 16, kDown = 12;
  const Vector3d axis = (to - from).normalized(), side = axis.unitOrthogonal(),
                 other = axis.cross(side);
  Mesh mesh;
  mesh.positions_m.resize(kAround * (kDown + 1), 3);
  mesh.triangles.resize(2 * kAround * kDown, 3);
  for (int j = 0; j <= kDown; ++j) {
    // Rings keep off the poles by a little, so that no triangle collapses.
    const double polar = std::numbers::pi * (0.02 + 0.96 * j / kDown);
    const bool upper = 2 * j < kDown + 1;
    const Vector3d centre = upper ? to : from;
    const double radius = upper ? radius_to : radius_from;
    for (int i = 0; i < kAround; ++i) {
      const double angle = 2 * std::numbers::pi * i / kAround;
      mesh.positions_m.row(j * kAround + i) =
          centre + radius * (std::cos(polar) * axis +
                             std::sin(polar) * (std::cos(angle) * side + std::sin(angle) * other));
    }
  }
  int t = 0;
  for (int j = 0; j < kDown; ++j)
    for (int i = 0; i < kAround; ++i) {
      const int a = j * kAround + i, b = j * kAround + (i + 1) % kAround;
      mesh.triangles.row(t++) << a, a + kAround, b;
      mesh.triangles.row(t++) << b, a + kAround, b + kAround;
    }
  return mesh;
}

}  // namespace

Mesh loft(const std::vector<Ring>& rings, int around, float exponent) {
  Mesh mesh;
  const int count = static_cast<int>(rings.size());
  mesh.positions_m.resize(static_cast<Eigen::Index>(count) * around, 3);
  mesh.triangles.resize(static_cast<Eigen::Index>(2) * (count - 1) * around, 3);
  const auto bulge = [&](double c) {
    return std::copysign(std::pow(std::abs(c), 2.0 / exponent), c);
  };
  int t = 0;
  for (int j = 0; j < count; ++j)
    for (int i = 0; i < around; ++i) {
      const double angle = 2 * std::numbers::pi * i / around;
      mesh.positions_m.row(j * around + i) << rings[j].half_width_m * bulge(std::cos(angle)),
          rings[j].y_m, -rings[j].back_m - rings[j].half_depth_m * bulge(std::sin(angle));
      if (j + 1 == count) continue;
      const int a = j * around + i, b = j * around + (i + 1) % around;
      mesh.triangles.row(t++) << a, a + around, b;
      mesh.triangles.row(t++) << b, a + around, b + around;
    }
  return mesh;
}

Mesh hand_mesh() {
  Mesh hand;
  hand.positions_m.resize(0, 3);
  hand.triangles.resize(0, 3);
  for (int finger = 0; finger < 4; ++finger) {
    const double y = 0.0275 - 0.0182 * finger,
                 reach = finger == 3 ? 0.038 : 0.056 - 0.004 * std::abs(finger - 1);
    const Vector3d knuckle(-0.035, y, 0.0), middle(0.01, 1.04 * y, 0.006),
        tip(reach, 1.06 * y, -0.006);
    append(capsule(knuckle, middle, 0.0105, 0.0092), hand);
    append(capsule(middle, tip, 0.0092, 0.0078), hand);
    append(capsule(Vector3d(-0.105, 0.7 * y, 0), knuckle, 0.017, 0.0125), hand);  // palm
  }
  append(capsule(Vector3d(-0.095, 0.025, -0.008), Vector3d(-0.05, 0.062, -0.014), 0.017, 0.0105),
         hand);
  append(capsule(Vector3d(-0.05, 0.062, -0.014), Vector3d(-0.018, 0.07, -0.018), 0.0105, 0.0088),
         hand);
  append(capsule(Vector3d(-0.30, -0.03, 0.01), Vector3d(-0.11, 0.0, 0), 0.038, 0.027),
         hand);  // arm
  return hand;
}

}  // namespace semblance
