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

/// A strip clamped at one end, bent into a beam's first mode w = 1.8751^2 sqrt(B / (rho L^4)) and
/// let go without gravity.
struct VibratingStrip {
  static constexpr double length_m = 0.1, spacing_m = 0.005, bending = 1e-3, root = 1.87510407;
  const double frequency = root * root * std::sqrt(bending / 0.2) / (length_m * length_m);  // rad/s
  const double period_s = 2.0 * std::numbers::pi / frequency;
  const double step_s = period_s / 200.0;
  Fabric fabric = linear_fabric(20000.0, 100.0, bending);

  VibratingStrip() { set_viscosity(0.0); }

  void set_viscosity(double viscosity_s) {
    for (auto* modes : {&fabric.tension, &fabric.bending}) {
      for (ModeResponse& mode : *modes) mode.viscosity_s = viscosity_s;
    }
    fabric.shear.viscosity_s = viscosity_s;
  }

  ClothScene scene() const {
    ClothScene scene;
    scene.sheet = make_rectangle(length_m + spacing_m, 0.02, spacing_m);
    scene.fabric = fabric;
    scene.gravity_m_s2.setZero();
    scene.self_contact = false;
    scene.start_m = laid_flat(scene.sheet);
    const double sigma = (std::sinh(root) - std::sin(root)) / (std::cosh(root) + std::cos(root));
    for (Eigen::Index v = 0; v < scene.start_m.rows(); ++v) {
      const double x = scene.sheet.material_m(v, 0) - spacing_m;
      if (x < 1e-9) {
        scene.fixed.push_back(static_cast<int>(v));
        continue;
      }
      const double s = root * x / length_m;
      scene.start_m(v, 1) =
          1e-3 * (std::cosh(s) - std::cos(s) - sigma * (std::sinh(s) - std::sin(s)));
    }
    return scene;
  }

  /// Heights of the tip after each step, the start first.
  std::vector<double> tip_m(int periods) const {
    StepOptions options;
    options.scheme = TimeScheme::bdf2;
    options.tolerance = 1e-6;
    options.motion_tolerance = 0.0;
    options.linear_tolerance = 1e-6;
    ClothSystem system(scene(), options);
    ClothState state = system.start();
    const Eigen::Index tip = state.positions_m.rows() - 1;
    std::vector<double> out{state.positions_m(tip, 1)};
    for (int i = 0; i < 200 * periods; ++i) {
      // Forces are about 0.06 of the weight. Energies of 1e-9 J are too small for the line search
      // to tell apart to the last digits, so not every step is solved.
      EXPECT_LT(system.step(state, step_s).residual, 1e-4) << i;
      out.push_back(state.positions_m(tip, 1));
    }
    return out;
  }

  /// Amplitudes fall as exp(-rate t): from the first upper turn after the start to the last, each
  /// the top of a parabola through three steps.
  double decay_rate_1_s(int periods) const {
    const std::vector<double> y = tip_m(periods);
    std::vector<double> times_s, tops_m;
    for (std::size_t i = 1; i + 1 < y.size(); ++i) {
      if (y[i] < y[i - 1] || y[i] <= y[i + 1]) continue;
      const double slope = 0.5 * (y[i + 1] - y[i - 1]), bend = y[i + 1] - 2.0 * y[i] + y[i - 1];
      times_s.push_back(step_s * (static_cast<double>(i) - slope / bend));
      tops_m.push_back(y[i] - 0.5 * slope * slope / bend);
    }
    EXPECT_GE(tops_m.size(), 2u);
    return std::log(tops_m.front() / tops_m.back()) / (times_s.back() - times_s.front());
  }
};

TEST(Vibration, OfAStripHasTheBeamsFrequency) {
  const VibratingStrip strip;
  const std::vector<double> y = strip.tip_m(4);
  // Downward zero crossings, by linear interpolation.
  std::vector<double> crossings;
  for (std::size_t i = 1; i < y.size(); ++i) {
    if (y[i - 1] > 0.0 && y[i] <= 0.0)
      crossings.push_back(strip.step_s * (static_cast<double>(i) - y[i] / (y[i] - y[i - 1])));
  }
  ASSERT_EQ(crossings.size(), 4u);
  const double period_s = (crossings[3] - crossings[0]) / 3.0;
  RecordProperty("period_error", std::to_string(period_s / strip.period_s - 1.0));
  EXPECT_NEAR(period_s, strip.period_s, 0.01 * strip.period_s);
}

/// Rayleigh's damping: mass damping a makes every mode fade as exp(-a t / 2), which is met within
/// 0.1 % ...
TEST(Vibration, FadesByMassDampingAtHalfItsRate) {
  VibratingStrip strip;
  for (const double fraction : {0.05, 0.2}) {
    strip.fabric.mass_damping_1_s = fraction * strip.frequency;
    const double expected = 0.5 * strip.fabric.mass_damping_1_s;
    const double rate = strip.decay_rate_1_s(3);
    RecordProperty("error at " + std::to_string(fraction), std::to_string(rate / expected - 1.0));
    EXPECT_NEAR(rate, expected, 0.02 * expected) << fraction;
  }
}

/// ... and stiffness damping b as exp(-b w^2 t / 2), within 0.5 %, as w is within 0.25 %.
TEST(Vibration, FadesByViscosityWithTheSquareOfItsFrequency) {
  VibratingStrip strip;
  for (const double fraction : {0.05, 0.2}) {
    const double viscosity_s = fraction / strip.frequency;
    strip.set_viscosity(viscosity_s);
    const double expected = 0.5 * viscosity_s * strip.frequency * strip.frequency;
    const double rate = strip.decay_rate_1_s(3);
    RecordProperty("error at " + std::to_string(fraction), std::to_string(rate / expected - 1.0));
    EXPECT_NEAR(rate, expected, 0.02 * expected) << fraction;
  }
}

}  // namespace
}  // namespace semblance
