// The real head scan, stored as contours and swept back.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "semblance/geometry/cylindrical_scan.h"
#include "semblance/geometry/radial_sweep.h"
#include "semblance/io/mesh_io.h"
#include "support.h"

namespace semblance::testing {
namespace {

constexpr const char* kHead = "face/lee-perry-smith/LeePerrySmith.obj";

/// 512 x 512 samples; the file's unit is taken as a metre, which shares of the radius do not need.
RangeMap scan_head() {
  RangeMap map = scan_cylinder(read_obj(data_path(kHead).string()).mesh);
  fill_voids(map);
  return map;
}

double mean_error_m(const RangeMap& map, const RadialSweep& sweep) {
  return radial_error(map, sweep_radii(sweep)).mean_m;
}

TEST(HeadScan, OneContourInTenWithTangentsIsWithinAQuarterPercent) {
  SEMBLANCE_NEED_DATA(kHead);
  const RangeMap map = scan_head();
  const std::vector<int> rows = rows_every(static_cast<int>(map.rows()), 10);
  const double limit_m = 0.0025 * mean_radius_m(map);
  const auto error_m = [&](MeasuredTangent tangent, SweepForm form) {
    return mean_error_m(map, sweep_measured(map, rows, tangent, form));
  };
  EXPECT_LT(error_m(MeasuredTangent::averaged, SweepForm::double_scaling), limit_m);
  EXPECT_LT(error_m(MeasuredTangent::one_sided, SweepForm::double_scaling), limit_m);
  // Tangents are what the report says they are: without them there are waves.
  EXPECT_GT(error_m(MeasuredTangent::null, SweepForm::single_scaling),
            1.5 * error_m(MeasuredTangent::averaged, SweepForm::single_scaling));
}

TEST(HeadScan, FullMethodHasAtMostSeventyPercentOfASplinesError) {
  SEMBLANCE_NEED_DATA(kHead);
  const RangeMap map = scan_head();
  for (const int contours : {26, 52, 78, 103}) {
    const RadialSweep spline =
        sweep_spline(map, rows_equally(static_cast<int>(map.rows()), contours), SlopeRule::natural);
    PlacedSweepOptions options;
    options.numbers = spline.numbers_stored;
    const RadialSweep full = sweep_placed(map, options);
    EXPECT_LE(full.numbers_stored, spline.numbers_stored);
    EXPECT_LT(mean_error_m(map, full), 0.7 * mean_error_m(map, spline)) << contours << " contours";
  }
}

}  // namespace
}  // namespace semblance::testing
