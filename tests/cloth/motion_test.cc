// Laws of motion that hold whatever the fabric.
#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <cmath>

#include "semblance/cloth/cloth_system.h"
#include "sheets.h"

namespace semblance {
namespace {

ClothScene free_sheet() {
  ClothScene scene;
  scene.sheet = make_rectangle(0.1, 0.08, 0.01);
  scene.fabric = linear_fabric();
  scene.start_m = laid_flat(scene.sheet);
  scene.self_contact = false;
  return scene;
}

double energy_of(ClothSystem& system, const ClothState& state) {
  double kinetic = 0.0;
  for (Eigen::Index v = 0; v < state.positions_m.rows(); ++v) {
    kinetic += 0.5 * system.masses_kg()[v] * state.velocities_m_s.row(v).squaredNorm();
  }
  system.energy().begin_elastic();
  return kinetic + system.energy().energy(state.positions_m);
}

class Schemes : public testing::TestWithParam<TimeScheme> {
 protected:
  static StepOptions options() {
    StepOptions options;
    options.scheme = GetParam();
    options.tolerance = 1e-8;
    options.linear_tolerance = 1e-6;
    return options;
  }
};

INSTANTIATE_TEST_SUITE_P(Implicit, Schemes,
                         testing::Values(TimeScheme::implicit_euler, TimeScheme::bdf2),
                         [](const auto& test) {
                           return test.param == TimeScheme::bdf2 ? "Bdf2" : "ImplicitEuler";
                         });

TEST_P(Schemes, KeepMomentumAndNeverGainEnergy) {
  ClothScene scene = free_sheet();
  scene.gravity_m_s2.setZero();
  ClothSystem system(scene, options());
  ClothState state = system.start();
  state.velocities_m_s = 0.3 * random_points(scene.start_m.rows(), 1);
  const auto momentum = [&] {
    return Eigen::RowVector3d(
        (system.masses_kg().asDiagonal() * state.velocities_m_s).colwise().sum());
  };
  const Eigen::RowVector3d before = momentum();
  const double scale = system.masses_kg().sum() * 0.3;
  double energy = energy_of(system, state);
  for (int i = 0; i < 20; ++i) {
    const StepReport report = system.step(state, 2e-3);
    ASSERT_TRUE(report.solved) << i << " " << report.residual << " " << report.newton_iterations;
    EXPECT_LT((momentum() - before).norm(), 1e-4 * scale) << i;
    const double now = energy_of(system, state);
    EXPECT_LE(now, energy * (1.0 + 1e-6)) << i;
    energy = now;
  }
}

TEST_P(Schemes, FreeFallIsExactToTheirOrder) {
  ClothSystem system(free_sheet(), options());
  ClothState state = system.start();
  const int steps = 50;
  const double step_s = 0.004, time_s = steps * step_s;
  for (int i = 0; i < steps; ++i) system.step(state, step_s);
  const double exact = -0.5 * 9.80665 * time_s * time_s;
  const double first_order = 0.5 * 9.80665 * time_s * step_s;
  const double found = (state.positions_m - system.scene().start_m).col(1).mean();
  EXPECT_NEAR(found, exact,
              GetParam() == TimeScheme::bdf2 ? 0.05 * first_order : 1.05 * first_order);
}

/// Cos(w t) against the first mode of a clamped beam: w = 1.8751^2 sqrt(B / (rho L^4)).
TEST(Vibration, OfAStripHasTheBeamsFrequency) {
  ClothScene scene;
  const double length = 0.1, spacing = 0.005, bending = 1e-3;
  scene.sheet = make_rectangle(length + spacing, 0.02, spacing);
  scene.fabric = linear_fabric(20000.0, 100.0, bending);
  scene.gravity_m_s2.setZero();
  scene.self_contact = false;
  scene.start_m = laid_flat(scene.sheet);
  const double root = 1.87510407;
  const double sigma = (std::sinh(root) - std::sin(root)) / (std::cosh(root) + std::cos(root));
  for (Eigen::Index v = 0; v < scene.start_m.rows(); ++v) {
    const double x = scene.sheet.material_m(v, 0) - spacing;
    if (x < 1e-9) {
      scene.fixed.push_back(static_cast<int>(v));
      continue;
    }
    const double s = root * x / length;
    scene.start_m(v, 1) =
        1e-4 * (std::cosh(s) - std::cos(s) - sigma * (std::sinh(s) - std::sin(s)));
  }
  StepOptions options;
  options.scheme = TimeScheme::bdf2;
  options.tolerance = 1e-9;
  options.linear_tolerance = 1e-6;
  ClothSystem system(scene, options);
  ClothState state = system.start();
  const double frequency = root * root * std::sqrt(bending / 0.2) / (length * length);
  const double period_s = 2.0 * std::numbers::pi / frequency;
  const Eigen::Index tip = scene.start_m.rows() - 1;
  // Downward zero crossings of the tip, by linear interpolation.
  std::vector<double> crossings;
  double before = scene.start_m(tip, 1);
  const double step_s = period_s / 200.0;
  for (int i = 0; i < 900 && crossings.size() < 4; ++i) {
    system.step(state, step_s);
    const double now = state.positions_m(tip, 1);
    if (before > 0.0 && now <= 0.0)
      crossings.push_back(state.time_s - step_s * now / (now - before));
    before = now;
  }
  ASSERT_EQ(crossings.size(), 4u);
  EXPECT_NEAR((crossings[3] - crossings[0]) / 3.0, period_s, 0.01 * period_s);
}

}  // namespace
}  // namespace semblance
