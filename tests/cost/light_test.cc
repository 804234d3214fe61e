#include "semblance/cost/light.h"

#include <gtest/gtest.h>

#include <random>

namespace semblance {
namespace {

ShLight some_light() {
  ShLight light;
  for (int k = 0; k < 9; ++k) {
    light.coefficients[k] = Eigen::Vector3f(0.3f, -0.1f, 0.2f) / static_cast<float>(1 + k);
  }
  light.coefficients[0] = {1.5f, 1.2f, 1.8f};
  return light;
}

/// Points of a sphere in colours of their own, under the light.
LightEquations equations_under(const ShLight& light, bool front_only) {
  std::mt19937 random(3);
  std::normal_distribution<float> normal;
  std::uniform_real_distribution<float> colour(0.3f, 0.9f);
  LightEquations out;
  for (int i = 0; i < 400; ++i) {
    Eigen::Vector3f n(normal(random), normal(random), normal(random));
    n.normalize();
    if (front_only) n = {0.0f, 0.0f, 1.0f};
    const auto basis = sh_basis(n.x(), n.y(), n.z());
    float albedo[3], seen[3];
    for (int c = 0; c < 3; ++c) {
      float lit = 0.0f;
      for (int k = 0; k < 9; ++k) lit += basis[k] * light.coefficients[k][c];
      albedo[c] = colour(random);
      seen[c] = albedo[c] * std::sqrt(lit);
    }
    out.add(basis, albedo, seen, 1.0);
  }
  return out;
}

TEST(LightEquations, FindTheLightOfASphere) {
  const ShLight truth = some_light();
  const ShLight found = equations_under(truth, false).solve(ShLight(), 1e-9, 2);
  for (int k = 0; k < 9; ++k) {
    EXPECT_LT((found.coefficients[k] - truth.coefficients[k]).norm(), 1e-4f) << k;
  }
}

TEST(LightEquations, KeepWhatNothingTells) {
  const ShLight truth = some_light();
  const ShLight found = equations_under(truth, true).solve(truth, 0.1, 2);
  for (int k = 0; k < 9; ++k) {
    EXPECT_LT((found.coefficients[k] - truth.coefficients[k]).norm(), 1e-4f) << k;
  }
}

TEST(LightEquations, HoldTheSecondOrder) {
  ShLight before;
  for (int k = 4; k < 9; ++k) before.coefficients[k].setConstant(0.05f);
  const ShLight found = equations_under(some_light(), false).solve(before, 0.01, 1);
  for (int k = 4; k < 9; ++k) {
    EXPECT_LT((found.coefficients[k] - before.coefficients[k]).norm(), 1e-4f) << k;
  }
  EXPECT_GT((found.coefficients[0] - before.coefficients[0]).norm(), 0.1f);
}

}  // namespace
}  // namespace semblance
