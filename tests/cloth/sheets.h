// Sheets and fabrics that the cloth's tests share.
#pragma once

#include <gtest/gtest.h>

#include <cmath>

#include "semblance/cloth/rest.h"
#include "semblance/core/random.h"

namespace semblance {

/// Straight curves, no friction: what closed forms need.
inline Fabric linear_fabric(double tension_n_m = 5000.0, double shear_n_m = 60.0,
                            double bending_n_m = 1e-4) {
  Fabric fabric;
  fabric.name = "linear";
  fabric.area_density_kg_m2 = 0.2;
  fabric.thickness_m = 1e-3;
  fabric.tension = {linear_response(tension_n_m, 0.1), linear_response(tension_n_m, 0.1)};
  fabric.shear = linear_response(shear_n_m, 0.14);
  fabric.bending = {linear_response(bending_n_m, 250.0), linear_response(bending_n_m, 250.0)};
  return fabric;
}

/// (u, v) at (x, -z), so that the front looks up.
inline Points laid_flat(const Sheet& sheet) {
  Points x = Points::Zero(sheet.vertex_count(), 3);
  x.col(0) = sheet.material_m.col(0);
  x.col(2) = -sheet.material_m.col(1);
  return x;
}

/// Curved, sheared, stretched here and compressed there, and rough by `noise_m`.
inline Points crumpled(const Sheet& sheet, double noise_m, std::uint64_t seed = 1) {
  Random random(seed);
  Points x(sheet.vertex_count(), 3);
  for (Eigen::Index i = 0; i < x.rows(); ++i) {
    const double u = sheet.material_m(i, 0), v = sheet.material_m(i, 1);
    x.row(i) << 1.01 * u, 0.01 * std::sin(30.0 * u) * std::cos(20.0 * v), 0.99 * v + 0.1 * u;
    for (int c = 0; c < 3; ++c) x(i, c) += noise_m * random.normal();
  }
  return x;
}

/// Positions at rest; a failure where there is none.
inline Points rest_of(const ClothScene& scene, double tolerance) {
  StepOptions options;
  options.scheme = TimeScheme::quasistatic;
  options.linear_solver = scene.sheet.grid ? "lines" : "direct";
  ClothSystem system(scene, options);
  ClothState state = system.start();
  RestOptions rest;
  rest.tolerance = tolerance;
  EXPECT_TRUE(settle(system, state, rest, silent_progress()).at_rest);
  return state.positions_m;
}

/// By its products with unit vectors.
inline Eigen::MatrixXd dense(const BlockMatrix& a) {
  const int n = a.pattern->row_count();
  Eigen::MatrixXd out(3 * n, 3 * n);
  for (int k = 0; k < 3 * n; ++k) {
    BlockVector unit = BlockVector::Zero(4, n), column;
    unit(k % 3, k / 3) = 1.0;
    a.multiply(unit, column);
    for (int i = 0; i < n; ++i) out.block<3, 1>(3 * i, k) = column.col(i).head<3>();
  }
  return out;
}

inline Points random_points(Eigen::Index rows, std::uint64_t seed) {
  Random random(seed);
  Points out(rows, 3);
  for (Eigen::Index i = 0; i < out.size(); ++i) out.data()[i] = random.normal();
  return out;
}

}  // namespace semblance
