// `semblance sweep scan` and `sweep reconstruct` on files that can and cannot be used.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "program.h"
#include "semblance/geometry/radial_sweep.h"
#include "semblance/io/mesh_io.h"
#include "semblance/io/range_map_io.h"
#include "support.h"

namespace semblance::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

constexpr int kWrongUsage = 2, kBadInput = 3;

/// A vase: a closed form to scan, 64 x 48 samples.
RangeMap make_vase() {
  RangeMap map;
  map.spacing_m = 0.005;
  map.radius_m = Grid::NullaryExpr(48, 64, [](Eigen::Index row, Eigen::Index column) {
    const double h = 0.2 * static_cast<double>(row), a = 0.3 * static_cast<double>(column % 20);
    return static_cast<float>(0.08 + 0.02 * std::sin(h) + 0.002 * std::sin(a));
  });
  map.samples = RangeMap::Samples::Constant(48, 64, RangeSample::measured);
  return map;
}

class SweepReconstruct : public ::testing::Test {
 protected:
  SweepReconstruct() {
    write_range_map(path("vase.json"), make_vase(), RangeEncoding::exr);
    write_ply(path("vase.ply"), mesh_from_range_map(make_vase()));
  }
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }
  ProgramResult sweep(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), "sweep");
    arguments.insert(arguments.end(), {"-o", path("out")});
    return run_program(arguments);
  }
  void expect_failure(const std::vector<std::string>& arguments, int code, const char* text) const {
    const ProgramResult run = sweep(arguments);
    EXPECT_EQ(run.exit_code, code) << run.output;
    EXPECT_THAT(run.output, HasSubstr(text));
    EXPECT_FALSE(fs::exists(path("out")));
  }

  TemporaryFolder folder_;
};

TEST_F(SweepReconstruct, ScansAndReconstructs) {
  const ProgramResult scan = sweep({"scan", path("vase.ply"), "--rows", "40", "--columns", "64",
                                    "--format", "exr", "--unit-m", "2"});
  ASSERT_EQ(scan.exit_code, 0) << scan.output;
  const RangeMap map = read_range_map(path("out/range_map.json"));
  EXPECT_EQ(map.rows(), 40);
  EXPECT_NEAR(mean_radius_m(map), 2 * mean_radius_m(make_vase()), 2e-3);

  const std::string json_path = path("summary.json");
  const ProgramResult run =
      sweep({"reconstruct", path("vase.json"), "--method", "averaged", "--every", "6", "--form",
             "double", "--format", "exr", "--picture", path("views.png"), "--json", json_path});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  // The library says the same.
  const RangeMap vase = make_vase();
  const RadialSweep expected =
      sweep_measured(vase, rows_every(48, 6), MeasuredTangent::averaged, SweepForm::double_scaling);
  const Grid radii = sweep_radii(expected);
  const RangeMap swept = read_range_map(path("out/range_map.json"));
  EXPECT_EQ((swept.radius_m - radii).abs().maxCoeff(), 0.0f);
  std::ifstream file(json_path);
  const auto summary = nlohmann::json::parse(file);
  EXPECT_EQ(summary.at("numbers"), expected.numbers_stored);
  EXPECT_DOUBLE_EQ(summary.at("error").at("mean_m"), radial_error(vase, radii).mean_m);
  EXPECT_EQ(read_ply(path("out/reconstruction.ply")).vertex_count(), 48 * 64);
  EXPECT_TRUE(fs::exists(path("out/errors.png")));
  EXPECT_TRUE(fs::exists(path("views.png")));
}

TEST_F(SweepReconstruct, RestoresTheSameSurfaceFromItsFile) {
  const std::vector<std::vector<std::string>> methods{
      {"--budget", "12", "--panel-columns", "20"},
      {"--method", "one-sided", "--form", "single", "-n", "0.3"},
      {"--method", "fitted", "--fit", "profile"}};
  for (const std::vector<std::string>& method : methods) {
    std::vector<std::string> arguments{"reconstruct", path("vase.json")};
    arguments.insert(arguments.end(), method.begin(), method.end());
    const ProgramResult run = sweep(arguments);
    ASSERT_EQ(run.exit_code, 0) << run.output;
    const ProgramResult restored = run_program(
        {"sweep", "restore", path("out/stored.json"), "-o", path("again"), "--format", "png16"});
    ASSERT_EQ(restored.exit_code, 0) << restored.output;
    for (const char* name :
         {"reconstruction.ply", "range_map.json", "range_map.png", "range_map_samples.png"}) {
      const std::string bytes = file_bytes(path("out/") + name);
      EXPECT_FALSE(bytes.empty());
      EXPECT_EQ(file_bytes(path("again/") + name), bytes) << name;
    }
  }
}

TEST_F(SweepReconstruct, RestoresNothingFromOtherFiles) {
  expect_failure({"restore", path("vase.json")}, kBadInput, "semblance.radial_sweep/1");
  expect_failure({"restore", path("absent.json")}, kBadInput, "absent.json");
  expect_failure({"restore", path("vase.json"), "--picture", path("a.tiff")}, kBadInput, ".png");
}

TEST_F(SweepReconstruct, ComparesAtEqualNumbers) {
  const std::string json_path = path("summary.json");
  const ProgramResult run = sweep({"reconstruct", path("vase.json"), "--compare",
                                   "--compare-budgets", "9", "12", "--json", json_path});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("at most 768 numbers"));
  std::ifstream file(json_path);
  const auto summary = nlohmann::json::parse(file);
  const auto& rows = summary.at("comparison");
  EXPECT_GE(rows.size(), 2u * 10u);
  for (const auto& row : rows) {
    EXPECT_LE(row.at("numbers").get<int>(), row.at("budget_numbers").get<int>()) << row;
    EXPECT_GT(row.at("error").at("mean_m").get<double>(), 0.0);
  }
}

TEST_F(SweepReconstruct, LeavesVoidWhatOvershootsTheAxis) {
  // The slope across a step, carried on below it, leads beyond the axis.
  RangeMap step = make_vase();
  step.radius_m.topRows(25).setConstant(0.02f);
  step.radius_m.bottomRows(23).setConstant(0.5f);
  write_range_map(path("step.json"), step, RangeEncoding::exr);
  const ProgramResult run = sweep({"reconstruct", path("step.json"), "--method", "averaged",
                                   "--every", "24", "--form", "double", "--format", "exr"});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("beyond the axis"));
  const Grid radii = sweep_radii(sweep_measured(step, rows_every(48, 24), MeasuredTangent::averaged,
                                                SweepForm::double_scaling));
  const RangeMap swept = read_range_map(path("out/range_map.json"));
  EXPECT_TRUE(((swept.samples == RangeSample::none) == (radii <= 0.0f)).all());
  EXPECT_EQ(read_ply(path("out/reconstruction.ply")).vertex_count(), (radii > 0.0f).count());
}

TEST_F(SweepReconstruct, RefusesWhatItCannotUse) {
  expect_failure({"reconstruct", path("vase.json"), "--every", "48"}, kBadInput, "fewer than two");
  expect_failure({"reconstruct", path("vase.json"), "--every", "0"}, kBadInput, "between 1 and 47");
  expect_failure({"reconstruct", path("vase.json"), "--method", "null", "-n", "-1"}, kBadInput,
                 "above -1");
  expect_failure({"reconstruct", path("vase.json"), "--budget", "1"}, kBadInput,
                 "raise the budget");
  expect_failure({"reconstruct", path("vase.json"), "--picture", path("a.tiff")}, kBadInput,
                 ".png");
  expect_failure({"reconstruct", path("vase.json"), "--method", "averaged", "--budget", "3"},
                 kBadInput, "raise the budget");
  expect_failure({"reconstruct", path("absent.json")}, kBadInput, "absent.json");
  expect_failure({"reconstruct", path("vase.exr")}, kBadInput, "was expected");
  expect_failure({"scan", path("vase.ply"), "--axis-point", "5", "0", "0"}, kBadInput, "vase.ply");
  expect_failure({"scan", path("vase.ply"), "--up", "0", "0", "1"}, kBadInput, "up and front");
  std::ofstream(path("points.obj")) << "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  expect_failure({"scan", path("points.obj")}, kBadInput, "points.obj");
}

TEST_F(SweepReconstruct, ExplainsWrongUsage) {
  expect_failure({"reconstruct", path("vase.json"), "--method", "magic"}, kWrongUsage, "--method");
  expect_failure({"reconstruct", path("vase.json"), "--every", "5", "--budget", "9"}, kWrongUsage,
                 "--budget");
  // Options without effect.
  expect_failure({"reconstruct", path("vase.json"), "--form", "single"}, kWrongUsage, "--form");
  expect_failure({"reconstruct", path("vase.json"), "-n", "2"}, kWrongUsage, "--blend");
  expect_failure({"reconstruct", path("vase.json"), "--rows", "64"}, kWrongUsage, "--rows");
  expect_failure({"reconstruct", path("vase.json"), "--compare-budgets", "9"}, kWrongUsage,
                 "--compare");
  expect_failure({"scan", path("vase.ply"), "--rows", "1"}, kWrongUsage, "--rows");
  expect_failure({"scan", path("vase.ply"), "--unit-m", "-1"}, kWrongUsage, "--unit-m");
  expect_failure({"reconstruct", path("vase.json"), "--panel-columns", "0"}, kWrongUsage,
                 "--panel-columns");
}

TEST_F(SweepReconstruct, RefusesPicturesOfAnotherScan) {
  RangeMap small = make_vase();
  small.radius_m.conservativeResize(20, 64);
  small.samples.conservativeResize(20, 64);
  write_range_map(path("small.json"), small, RangeEncoding::png16);
  fs::copy_file(path("small_samples.png"), path("vase_samples.png"),
                fs::copy_options::overwrite_existing);
  expect_failure({"reconstruct", path("vase.json")}, kBadInput, "header says");
}

}  // namespace
}  // namespace semblance::testing
