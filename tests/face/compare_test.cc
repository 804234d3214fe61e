#include "semblance/face/compare_optimizers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "semblance/core/errors.h"
#include "semblance/core/parallel.h"
#include "semblance/synth/generate.h"
#include "support.h"

namespace semblance {
namespace {

using ::testing::ElementsAreArray;

/// A short, small clip, and a comparison quick enough for a unit test.
class CompareTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new semblance::testing::TemporaryFolder;
    FaceClipSpec spec;
    spec.seed = 7;
    spec.density = 0.8;
    spec.frames = 4;
    spec.width = 240, spec.height = 180, spec.focal_px = 230;
    spec.look.skin_tone = 0.8;
    files_ = new ClipFiles(generate_clip(spec, (folder_->path() / "clip").string()));
  }
  static void TearDownTestSuite() {
    delete files_;
    delete folder_;
  }

  static CompareOptions options() {
    CompareOptions options;
    options.video = files_->video;
    options.camera = files_->camera;
    options.truth = files_->truth;
    options.frames = 2;
    options.gradient_budgets = {8};
    options.sampling_budgets = {60, 200};
    return options;
  }
  static OptimizerComparison compare() { return compare_optimizers(options(), silent_progress()); }

  static semblance::testing::TemporaryFolder* folder_;
  static ClipFiles* files_;
};

semblance::testing::TemporaryFolder* CompareTest::folder_ = nullptr;
ClipFiles* CompareTest::files_ = nullptr;

TEST_F(CompareTest, EveryMethodImprovesOnTheStartWithinItsBudget) {
  const OptimizerComparison c = compare();
  ASSERT_EQ(c.frames.size(), 2u);
  EXPECT_EQ(c.methods.size(), 2u + 5u * 2u);
  for (const ComparedMethod& method : c.methods) {
    ASSERT_EQ(method.solutions.size(), c.frames.size()) << method.name;
    for (std::size_t i = 0; i < c.frames.size(); ++i) {
      const ComparedSolution& s = method.solutions[i];
      EXPECT_LT(s.cost, c.starts[i].cost) << method.name << ' ' << method.budget;
      EXPECT_GE(s.cost, c.least_cost[i]) << method.name;
      ASSERT_FALSE(s.trace.empty()) << method.name;
      EXPECT_EQ(s.trace.back().cost, s.cost) << method.name;
      EXPECT_EQ(s.to_best_px == 0.0, s.cost == c.least_cost[i]) << method.name;
      if (method.name != "lm" && method.name != "ceres") {
        EXPECT_LE(s.evaluations, method.budget) << method.name;
      }
    }
  }
  // From starts that are wrong by a few pixels, the gradient brings the face nearer to the truth.
  for (std::size_t i = 0; i < c.frames.size(); ++i) {
    EXPECT_LT(c.methods[0].solutions[i].to_truth_px, c.starts[i].to_truth_px);
  }
}

TEST_F(CompareTest, IsTheSameForASeedWhateverTheThreadCount) {
  const OptimizerComparison two = compare();
  set_thread_count(1);
  const OptimizerComparison one = compare();
  set_thread_count(0);
  EXPECT_THAT(one.frames, ElementsAreArray(two.frames));
  for (std::size_t m = 0; m < two.methods.size(); ++m) {
    for (std::size_t i = 0; i < two.frames.size(); ++i) {
      const ComparedSolution &a = one.methods[m].solutions[i], &b = two.methods[m].solutions[i];
      EXPECT_EQ(a.cost, b.cost) << two.methods[m].name;
      EXPECT_EQ(a.evaluations, b.evaluations) << two.methods[m].name;
      EXPECT_EQ(a.to_truth_px, b.to_truth_px) << two.methods[m].name;
    }
  }
}

TEST(ComparisonTableTest, TakesMediansAndReadsTheTraces) {
  OptimizerComparison c;
  c.frames = {3, 5, 9};
  c.least_cost = {1.0, 2.0, 3.0};
  for (const double cost : {11.0, 22.0, 33.0}) c.starts.push_back({.cost = cost, .trace = {}});
  ComparedMethod method{"lm", 10, {}};
  const double after_six[] = {5.0, 4.0, 9.0}, last[] = {1.5, 2.25, 3.0};
  for (int i = 0; i < 3; ++i) {
    method.solutions.push_back({.cost = last[i],
                                .evaluations = 7 + i,
                                .seconds = 0.2,
                                .to_best_px = 0.4 * i,
                                .to_truth_px = 1.0 + i,
                                .trace = {{6, 0.02, after_six[i]}, {7 + i, 0.2, last[i]}}});
  }
  c.methods = {method};
  const nlohmann::json json = nlohmann::json::parse(comparison_json(c));
  EXPECT_EQ(json["start"]["excess_cost"], 20.0);
  EXPECT_EQ(json["methods"][0]["excess_cost"], 0.25);
  EXPECT_EQ(json["methods"][0]["evaluations"], 8.0);
  EXPECT_EQ(json["methods"][0]["to_truth_px"], 2.0);
  EXPECT_EQ(json["methods"][0]["near_best"], 2);
  const auto& by_evaluations = json["curves"][0]["excess_by_evaluations"];
  EXPECT_EQ(by_evaluations[0], 20.0);  // 5: still the start
  EXPECT_EQ(by_evaluations[1], 0.25);  // 10: the end
  const auto& by_seconds = json["curves"][0]["excess_by_seconds"];
  EXPECT_EQ(by_seconds[1], 4.0);  // 0.03 s: of 4, 2 and 6 above the least
}

TEST_F(CompareTest, NamesTheFileThatDoesNotFit) {
  CompareOptions wrong = options();
  wrong.truth = files_->camera;
  EXPECT_THROW(compare_optimizers(wrong, silent_progress()), InvalidInput);
  wrong = options();
  wrong.frames = 4;  // the first gives the texture
  EXPECT_THROW(compare_optimizers(wrong, silent_progress()), SolverError);
}

}  // namespace
}  // namespace semblance
