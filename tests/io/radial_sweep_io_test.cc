#include "semblance/io/radial_sweep_io.h"

#include <gmock/gmock.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "files.h"
#include "semblance/core/errors.h"
#include "semblance/geometry/scan_storage.h"
#include "support.h"

namespace semblance {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::TemporaryFolder;
using ::testing::ThrowsMessage;
using testing::write_text;

/// A body with a nose, in a frame of its own.
RangeMap make_map() {
  RangeMap map;
  map.spacing_m = 0.007;
  map.bottom_m = -0.31;
  map.world_from_map = Rigid3{quaternion_from_rotation_vector({0.1, 2.0, -0.4}), {0.5, 1.0, -2.0}};
  map.radius_m.resize(41, 24);
  for (Eigen::Index row = 0; row < 41; ++row) {
    for (Eigen::Index column = 0; column < 24; ++column) {
      const double h = 0.1 * static_cast<double>(row), a = map.column_angle_rad(column);
      map.radius_m(row, column) =
          static_cast<float>(0.1 + 0.01 * std::sin(3 * h) * std::cos(a) +
                             0.04 * std::exp(-9 * (h - 2) * (h - 2) - a * a));
    }
  }
  map.samples = RangeMap::Samples::Constant(41, 24, RangeSample::measured);
  return map;
}

RadialSweep stored(StorageMethod method, SweepForm form, BlendShare share = BlendShare::pair) {
  StorageOptions options;
  options.method = method;
  options.form = form;
  options.share = share;
  options.budget_contours = 20;
  options.n = 0.1;
  options.panel_columns = 10;  // panels of 10, 10 and 4 columns
  return store_scan(make_map(), options);
}

class RadialSweepIo : public ::testing::Test {
 protected:
  std::string path() const { return (folder_.path() / "stored.json").string(); }
  nlohmann::json written(const RadialSweep& sweep) const {
    write_radial_sweep(path(), sweep);
    std::ifstream file(path());
    return nlohmann::json::parse(file);
  }
  void expect_rejected(const nlohmann::json& json, const char* text) const {
    write_text(path(), json.dump());
    EXPECT_THAT([&] { read_radial_sweep(path()); },
                ThrowsMessage<InvalidInput>(AllOf(HasSubstr("stored.json"), HasSubstr(text))));
  }

 private:
  TemporaryFolder folder_;
};

/// Numbers, names and marks in a value.
std::int64_t leaves(const nlohmann::json& json) {
  if (!json.is_structured()) return 1;
  std::int64_t sum = 0;
  for (const auto& entry : json) sum += leaves(entry);
  return sum;
}

TEST_F(RadialSweepIo, KeepsTheSurfaceToTheLastBit) {
  const auto single = SweepForm::single_scaling, both = SweepForm::double_scaling;
  for (const RadialSweep& sweep :
       {stored(StorageMethod::null, single), stored(StorageMethod::one_sided, both),
        stored(StorageMethod::averaged, single), stored(StorageMethod::fitted, both),
        stored(StorageMethod::fitted, single, BlendShare::profile),
        stored(StorageMethod::full, both),
        sweep_spline(make_map(), rows_equally(41, 7), SlopeRule::natural)}) {
    write_radial_sweep(path(), sweep);
    const RadialSweep found = read_radial_sweep(path());
    const RangeMap expected = swept_map(sweep), swept = swept_map(found);
    EXPECT_TRUE((swept.radius_m == expected.radius_m).all());
    EXPECT_EQ(swept.point(3, 5), expected.point(3, 5));
    EXPECT_EQ(swept.point(40, 23), expected.point(40, 23));
    EXPECT_EQ(found.form, sweep.form);
    EXPECT_EQ(found.numbers_stored, sweep.numbers_stored);
  }
}

TEST_F(RadialSweepIo, HoldsAsManyNumbersAsTheSweepSays) {
  // For the full method every panel's size, seam, rows, rules, n and radii count.
  const RadialSweep full = stored(StorageMethod::full, SweepForm::double_scaling);
  EXPECT_EQ(leaves(written(full).at("panels")), full.numbers_stored);
  // The rows of equally spaced contours do not, nor do the panel's size and an n for all.
  const auto single = SweepForm::single_scaling;
  for (const StorageMethod method :
       {StorageMethod::null, StorageMethod::one_sided, StorageMethod::averaged}) {
    const RadialSweep sweep = stored(method, single);
    const auto contours = static_cast<std::int64_t>(sweep.panels[0].rows.size());
    EXPECT_EQ(leaves(written(sweep).at("panels")), sweep.numbers_stored + contours + 2);
  }
  const RadialSweep fitted = stored(StorageMethod::fitted, single, BlendShare::profile);
  const auto contours = static_cast<std::int64_t>(fitted.panels[0].rows.size());
  EXPECT_EQ(leaves(written(fitted).at("panels")), fitted.numbers_stored + contours + 1);
}

TEST_F(RadialSweepIo, RejectsWhatCannotBeSwept) {
  const nlohmann::json good = written(stored(StorageMethod::full, SweepForm::double_scaling));
  const auto with = [&](const char* pointer, const nlohmann::json& value) {
    nlohmann::json json = good;
    json[nlohmann::json::json_pointer(pointer)] = value;
    return json;
  };
  expect_rejected(with("/schema", "semblance.sweep/1"), "semblance.radial_sweep/1");
  expect_rejected(with("/form", "triple"), "double_scaling");
  expect_rejected(with("/rows", 1), "from 2 to 8192");
  expect_rejected(with("/rows", 1000000000), "from 2 to 8192");
  expect_rejected(with("/rows", 50), "row 49");
  expect_rejected(with("/columns", 30), "cover all columns");
  expect_rejected(with("/columns", 20), "20 over all panels");
  expect_rejected(with("/spacing_m", 0), "spacing_m");
  expect_rejected(with("/rotation_wxyz", {1, 1, 0, 0}), "length 1");
  expect_rejected(with("/panels", nlohmann::json::array()), "cover all columns");
  expect_rejected(with("/panels/0/columns", 0), "panels[0].columns");
  expect_rejected(with("/panels/1/rows/1", 0), "must increase");
  expect_rejected(with("/panels/1/rows/1", -3), "whole numbers");
  expect_rejected(with("/panels/1/rows", {0}), "at least two contours");
  expect_rejected(with("/panels/1/radius_m/0", {0.1}), "lists of 10 numbers");
  expect_rejected(with("/panels/1/radius_m/0/3", -0.1), "finite and positive");
  expect_rejected(with("/panels/1/radius_m/0/3", 1e300), "finite numbers");
  expect_rejected(with("/panels/1/radius_m/0/3", nullptr), "finite numbers");
  expect_rejected(with("/panels/1/tangents/0", "magic"), "monotone");
  expect_rejected(with("/panels/1/n", -1), "above -1");
  expect_rejected(with("/panels/1/n", {0.5}), "panels[1].n");
  expect_rejected(with("/panels/1/start_slope", {{0.1}}), "start_slope");
  expect_rejected(with("/panels/1/colour", "red"), "unknown key 'colour'");
  for (const char* key : {"form", "rows", "columns", "bottom_m", "spacing_m", "panels"}) {
    nlohmann::json json = good;
    json.erase(key);
    expect_rejected(json, key);
  }
  write_text(path(), "{\"schema\":");
  EXPECT_THAT([&] { read_radial_sweep(path()); },
              ThrowsMessage<InvalidInput>(HasSubstr("not valid JSON")));
}

TEST_F(RadialSweepIo, WritesNothingThatCannotBeRead) {
  RadialSweep sweep = stored(StorageMethod::null, SweepForm::single_scaling);
  sweep.panels[0].radius_m(1, 1) = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(write_radial_sweep(path(), sweep), InvalidInput);
  EXPECT_FALSE(std::filesystem::exists(path()));
}

}  // namespace
}  // namespace semblance
