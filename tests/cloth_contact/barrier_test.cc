#include "semblance/cloth/barrier.h"

#include <gmock/gmock.h>

namespace semblance {
namespace {

constexpr double reach = 1.3e-3, p0 = 250.0;

TEST(Barrier, PressureAndStiffnessAreDifferences) {
  for (const double s : {1e-3, 0.01, 0.1, 0.4, 0.8, 0.97}) {
    const double d = s * reach, h = 1e-5 * d;
    const BarrierValue at = barrier(d, reach, p0);
    const BarrierValue up = barrier(d + h, reach, p0), down = barrier(d - h, reach, p0);
    EXPECT_NEAR(-(up.energy_j_m2 - down.energy_j_m2) / (2.0 * h), at.pressure_pa,
                1e-8 * at.pressure_pa + 1e-7 * p0);
    EXPECT_NEAR(-(up.pressure_pa - down.pressure_pa) / (2.0 * h), at.stiffness_pa_m,
                1e-8 * at.stiffness_pa_m);
  }
}

TEST(Barrier, EndsWithTwoContinuousDerivatives) {
  const BarrierValue end = barrier(reach * (1.0 - 1e-6), reach, p0);
  EXPECT_LT(end.energy_j_m2, 1e-15 * p0);
  EXPECT_LT(end.pressure_pa, 1e-11 * p0);
  EXPECT_LT(end.stiffness_pa_m, 1e-4 * p0 / reach);
  EXPECT_EQ(barrier(reach, reach, p0).energy_j_m2, 0.0);
  EXPECT_EQ(barrier(1.0, reach, p0).stiffness_pa_m, 0.0);
}

TEST(Barrier, IsInfiniteWhereSurfacesMeet) {
  EXPECT_TRUE(std::isinf(barrier(0.0, reach, p0).energy_j_m2));
  EXPECT_TRUE(std::isinf(barrier(-1e-6, reach, p0).pressure_pa));
  EXPECT_GT(barrier(1e-9, reach, p0).pressure_pa, 1e5 * p0);
}

}  // namespace
}  // namespace semblance
