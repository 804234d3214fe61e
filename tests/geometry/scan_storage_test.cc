#include "semblance/geometry/scan_storage.h"

#include <gmock/gmock.h>

#include <cmath>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

RangeMap make_map() {
  RangeMap map;
  map.spacing_m = 0.01;
  map.radius_m = Grid::NullaryExpr(60, 20, [](Eigen::Index row, Eigen::Index column) {
    return static_cast<float>(0.1 + 0.01 * std::sin(0.3 * static_cast<double>(row)) +
                              0.001 * static_cast<double>(column % 7));
  });
  map.samples = RangeMap::Samples::Constant(60, 20, RangeSample::measured);
  return map;
}

TEST(ScanStorage, KeepsTheBudgetAndWouldNotWithOneContourMore) {
  const RangeMap map = make_map();
  for (const StorageMethod method : {StorageMethod::null, StorageMethod::one_sided,
                                     StorageMethod::averaged, StorageMethod::fitted}) {
    for (const BlendShare share : {BlendShare::pair, BlendShare::profile}) {
      for (const int budget : {6, 10, 13, 500}) {
        StorageOptions options;
        options.method = method;
        options.share = share;
        options.budget_contours = budget;
        const RadialSweep sweep = store_scan(map, options);
        const auto contours = static_cast<int>(sweep.panels[0].rows.size());
        EXPECT_EQ(sweep.panels[0].rows, rows_equally(60, contours));
        EXPECT_LE(sweep.numbers_stored, budget * 20);
        if (contours == 60) continue;
        // What one contour more would take, by storing it.
        StorageOptions more = options;
        do {
          more.budget_contours = *more.budget_contours + 1;
        } while (store_scan(map, more).panels[0].rows.size() == sweep.panels[0].rows.size());
        EXPECT_GT(store_scan(map, more).numbers_stored, budget * 20);
      }
    }
  }
}

TEST(ScanStorage, IsWhatTheMethodsStore) {
  const RangeMap map = make_map();
  StorageOptions options;
  options.method = StorageMethod::one_sided;
  options.form = SweepForm::single_scaling;
  options.n = 2.0;
  options.every = 7;
  const RadialSweep expected = sweep_measured(map, rows_every(60, 7), MeasuredTangent::one_sided,
                                              SweepForm::single_scaling, 2.0);
  EXPECT_TRUE((sweep_radii(store_scan(map, options)) == sweep_radii(expected)).all());
  options.method = StorageMethod::full;
  PlacedSweepOptions placed;
  placed.numbers = static_cast<std::int64_t>(rows_every(60, 7).size()) * 20;
  EXPECT_TRUE(
      (sweep_radii(store_scan(map, options)) == sweep_radii(sweep_placed(map, placed))).all());
}

TEST(ScanStorage, SaysWhenABudgetIsTooSmall) {
  const RangeMap map = make_map();
  for (const StorageMethod method :
       {StorageMethod::null, StorageMethod::one_sided, StorageMethod::averaged,
        StorageMethod::fitted, StorageMethod::full}) {
    StorageOptions options;
    options.method = method;
    options.budget_contours = 1;
    EXPECT_THAT([&] { store_scan(map, options); },
                ThrowsMessage<InvalidInput>(HasSubstr("raise the budget")));
  }
}

}  // namespace
}  // namespace semblance
