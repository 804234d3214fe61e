#include "semblance/cloth/rest.h"

#include <gmock/gmock.h>

#include <cmath>

#include "semblance/core/parallel.h"
#include "sheets.h"

namespace semblance {
namespace {

StepOptions quasistatic() {
  StepOptions options;
  options.scheme = TimeScheme::quasistatic;
  options.linear_tolerance = 0.5;
  options.most_newton_iterations = 20;
  return options;
}

/// A chain between two supports: y = a cosh(x / a), with 2 a sinh(span / (2 a)) = length.
TEST(Rest, OfALimpStripBetweenTwoSupportsIsTheCatenary) {
  ClothScene scene;
  const double length = 0.4, span = 0.3;
  scene.sheet = make_rectangle(length, 0.02, 0.01);
  scene.fabric = linear_fabric(2e4, 20.0, 1e-8);
  scene.self_contact = false;
  scene.start_m = laid_flat(scene.sheet);
  for (Eigen::Index v = 0; v < scene.start_m.rows(); ++v) {
    const double u = scene.sheet.material_m(v, 0);
    // A shallow sine of nearly the right length to start from.
    scene.start_m(v, 0) = u * span / length;
    scene.start_m(v, 1) = -0.1 * std::sin(std::numbers::pi * u / length);
    if (u < 1e-9 || u > length - 1e-9) {
      scene.start_m(v, 1) = 0.0;
      scene.fixed.push_back(static_cast<int>(v));
    }
  }
  ClothSystem system(scene, quasistatic());
  ClothState state = system.start();
  RestOptions options;
  options.tolerance = 1e-6;
  ASSERT_TRUE(settle(system, state, options, silent_progress()).at_rest);
  double low = 0.01, high = 10.0;
  for (int i = 0; i < 100; ++i) {
    const double a = 0.5 * (low + high);
    (2.0 * a * std::sinh(span / (2.0 * a)) > length ? low : high) = a;
  }
  const double sag = low * (std::cosh(span / (2.0 * low)) - 1.0);
  const double found = -state.positions_m.col(1).minCoeff();
  RecordProperty("sag_error", std::to_string(found / sag - 1.0));
  EXPECT_NEAR(found, sag, 0.01 * sag);
}

/// A small table: a sheet that hangs over its edges, slack and with self-contact.
ClothScene small_table(double spacing_m) {
  ClothScene scene;
  scene.sheet = make_rectangle(0.4, 0.32, spacing_m);
  scene.fabric = linear_fabric(5000.0, 60.0, 2e-5);
  scene.fabric.friction = 0.3;
  scene.start_m = laid_flat(scene.sheet);
  scene.start_m.rowwise() += Eigen::RowVector3d(-0.18, 0.0008, 0.17);
  Rigid3 pose;
  pose.translation_m = {0.0, -0.2, 0.0};
  scene.obstacles.push_back(make_box("table", {0.24, 0.4, 0.2}, pose));
  return scene;
}

TEST(Rest, OfASheetOnATableIsStillAndCrossesNothing) {
  ClothSystem system(small_table(0.02), quasistatic());
  ClothState state = system.start();
  RestOptions options;
  options.tolerance = 1e-4;
  const RestReport report = settle(system, state, options, silent_progress());
  ASSERT_TRUE(report.at_rest);
  EXPECT_LE(system.rest_residual(state), options.tolerance);
  EXPECT_THAT(system.contacts().penetrations(state.positions_m, true), testing::IsEmpty());
  // Let go without velocity, it stays.
  system.options().scheme = TimeScheme::implicit_euler;
  system.options().tolerance = 1e-5;
  state.velocities_m_s.setZero();
  state.previous_step_s = 0.0;
  for (int i = 0; i < 10; ++i) {
    system.step(state, 0.01);
    EXPECT_LT(state.velocities_m_s.rowwise().norm().maxCoeff(), 1e-4) << i;
  }
}

TEST(Rest, IsTheSameForEveryNumberOfThreads) {
  Points found[2];
  for (const int threads : {1, 2}) {
    set_thread_count(threads);
    ClothSystem system(small_table(0.04), quasistatic());
    ClothState state = system.start();
    settle(system, state, {}, silent_progress());
    found[threads - 1] = state.positions_m;
  }
  set_thread_count(0);
  EXPECT_EQ(found[0], found[1]);
}

TEST(Refine, KeepsTheSurface) {
  const Sheet coarse = make_rectangle(0.4, 0.32, 0.04), fine = make_rectangle(0.4, 0.32, 0.01);
  const Points x = crumpled(coarse, 1e-3);
  const Points y = refine(coarse, x, fine);
  for (Eigen::Index v = 0; v < coarse.vertex_count(); ++v) {
    const Eigen::RowVector2d at = coarse.material_m.row(v);
    Eigen::Index same;
    (fine.material_m.rowwise() - at).rowwise().norm().minCoeff(&same);
    EXPECT_LT((y.row(same) - x.row(v)).norm(), 1e-12);
  }
}

}  // namespace
}  // namespace semblance
