// Drape coefficients against closed forms, and the distance of shapes.
#include "semblance/cloth/drape.h"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

#include "semblance/cloth/presets.h"
#include "semblance/core/errors.h"

namespace semblance::testing {
namespace {

constexpr double disc_m = 0.09, specimen_m = 0.15;

/// The specimen with each point moved along its ray to `radius(r, angle)`, at `height(r)`.
template <class Radius, class Height>
Points shaped(const Sheet& sheet, const Radius& radius, const Height& height) {
  Points out(sheet.vertex_count(), 3);
  for (Eigen::Index v = 0; v < out.rows(); ++v) {
    const Eigen::Vector2d p = sheet.material_m.row(v);
    const double r = p.norm(), angle = std::atan2(p.y(), p.x());
    out.row(v) << radius(r, angle) * std::cos(angle), height(r),
        -radius(r, angle) * std::sin(angle);
  }
  return out;
}

double zero(double) { return 0.0; }

TEST(Drape, AFlatSpecimenHasAllOfIt) {
  const Sheet sheet = make_disc(specimen_m, 0.01);
  const DrapeProfile profile =
      measure_drape(sheet, lay_flat(sheet, Eigen::Vector3d::Zero()), {.disc_radius_m = disc_m});
  EXPECT_TRUE(profile.star_shaped);
  EXPECT_NEAR(profile.coefficient, 1.0, 1e-12);
  for (const double radius : profile.radii_m) EXPECT_NEAR(radius, specimen_m, 1e-3);
}

TEST(Drape, AConeHasThatOfItsAngle) {
  const Sheet sheet = make_disc(specimen_m, 0.0025);
  for (const double angle : {0.3, 0.8, 1.4}) {
    const double out_m = disc_m + (specimen_m - disc_m) * std::cos(angle);
    const auto radius = [&](double r, double) {
      return r <= disc_m ? r : disc_m + (r - disc_m) * std::cos(angle);
    };
    const auto height = [&](double r) { return -std::max(0.0, r - disc_m) * std::sin(angle); };
    const double expected =
        (out_m * out_m - disc_m * disc_m) / (specimen_m * specimen_m - disc_m * disc_m);
    const DrapeProfile profile =
        measure_drape(sheet, shaped(sheet, radius, height), {.disc_radius_m = disc_m});
    EXPECT_TRUE(profile.star_shaped);
    EXPECT_NEAR(profile.coefficient, expected, 1e-3) << angle;
    EXPECT_NEAR(profile.radii_m[100], out_m, 1e-4);
  }
}

TEST(Drape, LobesAreMeasuredRayByRay) {
  const Sheet sheet = make_disc(specimen_m, 0.0025);
  const auto radius = [](double r, double angle) {
    return r * (0.8 + 0.15 * std::cos(5.0 * angle));
  };
  const DrapeProfile profile =
      measure_drape(sheet, shaped(sheet, radius, zero), {.disc_radius_m = disc_m});
  EXPECT_TRUE(profile.star_shaped);
  const double mean_square = specimen_m * specimen_m * (0.64 + 0.5 * 0.15 * 0.15);
  EXPECT_NEAR(profile.shadow_area_m2, std::numbers::pi * mean_square, 2e-5);
  const auto at = [&](double angle) { return profile.radii_m[std::lround(angle * 2.0)]; };
  EXPECT_NEAR(at(0.0), 0.95 * specimen_m, 1e-4);
  EXPECT_NEAR(at(36.0), 0.65 * specimen_m, 1e-4);  // counter-clockwise from x
}

/// Where the cloth stands out over its hem the shadow is counted, not reckoned from the hem.
TEST(Drape, AHemThatTurnsInIsNotTheOutline) {
  const Sheet sheet = make_disc(specimen_m, 0.0025, 0.13);
  const auto radius = [](double r, double) { return r <= 0.13 ? r : 0.26 - r; };
  const DrapeProfile profile =
      measure_drape(sheet, shaped(sheet, radius, zero), {.disc_radius_m = disc_m});
  EXPECT_FALSE(profile.star_shaped);
  const double expected =
      (0.13 * 0.13 - disc_m * disc_m) / (specimen_m * specimen_m - disc_m * disc_m);
  EXPECT_NEAR(profile.coefficient, expected, 2e-3);
  EXPECT_NEAR(profile.radii_m[17], 0.13, 1e-4);
}

TEST(Drape, TheDiscMayStandAnywhereButMustBeSmaller) {
  const Sheet sheet = make_disc(specimen_m, 0.01);
  const Points moved = lay_flat(sheet, {0.4, 0.2, -0.3});
  EXPECT_NEAR(measure_drape(sheet, moved, {{0.4, -0.3}, disc_m}).coefficient, 1.0, 1e-12);
  EXPECT_THROW(measure_drape(sheet, moved, {{0.4, -0.3}, 0.2}), InvalidInput);
}

TEST(ShapeError, IsTheMeanDistanceOfCounterparts) {
  const Sheet coarse = make_rectangle(1.0, 0.8, 0.1), fine = make_rectangle(1.0, 0.8, 0.05);
  const Points a = lay_flat(coarse, Eigen::Vector3d::Zero());
  const Points b = lay_flat(fine, {0.03, 0.04, 0.0});
  EXPECT_NEAR(shape_error_m(coarse, a, fine, b), 0.05, 1e-12);
  EXPECT_NEAR(shape_error_m(fine, b, coarse, a), 0.05, 1e-12);
  EXPECT_NEAR(shape_error_m(fine, b, fine, b), 0.0, 1e-15);
}

TEST(ShapeError, RefusesAnotherPieceOfFabric) {
  const Sheet one = make_rectangle(1.0, 0.8, 0.1), other = make_rectangle(1.0, 1.0, 0.1);
  EXPECT_THROW(shape_error_m(one, lay_flat(one, Eigen::Vector3d::Zero()), other,
                             lay_flat(other, Eigen::Vector3d::Zero())),
               InvalidInput);
}

}  // namespace
}  // namespace semblance::testing
