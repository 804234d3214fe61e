#include "semblance/synth/clip_spec.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "semblance/core/errors.h"
#include "support.h"

namespace semblance {
namespace {

using ::testing::HasSubstr;

class SuiteTest : public ::testing::Test {
 protected:
  SynthSuite read(const std::string& text) {
    const auto path = folder_.path() / "suite.json";
    std::ofstream(path) << text;
    return read_suite(folder_.path().string());
  }
  std::string complaint(const std::string& text) {
    try {
      read(text);
    } catch (const InvalidInput& problem) {
      return problem.what();
    }
    return "";
  }
  testing::TemporaryFolder folder_;
};

constexpr const char* kHead = R"({"schema":"semblance.suite/1","name":"s",)";

TEST_F(SuiteTest, ClipsOverrideDefaults) {
  const SynthSuite suite =
      read(std::string(kHead) + R"("defaults":{"frames":7,"motion":{"yaw_deg":33}},
        "clips":[{"seed":4},{"name":"b","frames":9,"motion":{"pitch_deg":1}}]})");
  ASSERT_EQ(suite.clips.size(), 2u);
  EXPECT_EQ(suite.clips[0].name, "clip1");
  EXPECT_EQ(suite.clips[0].frames, 7);
  EXPECT_EQ(suite.clips[0].seed, 4u);
  EXPECT_EQ(suite.clips[1].frames, 9);
  EXPECT_EQ(suite.clips[1].motion.yaw_deg, 33);
  EXPECT_EQ(suite.clips[1].motion.pitch_deg, 1);
}

TEST_F(SuiteTest, AWrittenRecipeReadsBackTheSame) {
  FaceClipSpec spec;
  spec.name = "again";
  spec.seed = 99;
  spec.output = "mp4";
  spec.motion.distance_m = 0.75;
  spec.sensor.sub_frames = 3;
  spec.look.clutter = false;
  const std::string text = clip_spec_json(spec);
  const SynthSuite suite = read(std::string(kHead) + "\"clips\":[" + text + "]}");
  EXPECT_EQ(clip_spec_json(suite.clips[0]), text);
}

TEST_F(SuiteTest, ProblemsNameFileAndKey) {
  const std::string head = kHead;
  EXPECT_THAT(complaint("{}"), HasSubstr("suite.json: schema: expected"));
  EXPECT_THAT(complaint(head + R"("clips":[]})"), HasSubstr("clips"));
  EXPECT_THAT(complaint(head + R"("clips":[{"colour":1}]})"),
              HasSubstr("clips[0]: unknown key 'colour'"));
  EXPECT_THAT(complaint(head + R"("clips":[{"motion":{"yaw_deg":"wide"}}]})"),
              HasSubstr("clips[0].motion.yaw_deg: expected a number"));
  EXPECT_THAT(complaint(head + R"("clips":[{"frames":0}]})"), HasSubstr("from 1 to"));
  EXPECT_THAT(complaint(head + R"("clips":[{"frames":2.5}]})"), HasSubstr("a whole number"));
  EXPECT_THAT(complaint(head + R"("clips":[{"name":"../x"}]})"), HasSubstr(".name"));
  EXPECT_THAT(complaint(head + R"("clips":[{"name":"a"},{"name":"a"}]})"), HasSubstr("taken"));
  EXPECT_THAT(complaint(head + R"("clips":[{"sensor":{"samples":5}}]})"), HasSubstr("samples"));
  EXPECT_THAT(complaint("{\"schema\":"), HasSubstr("suite.json"));
}

TEST_F(SuiteTest, LipMarkersAreEightOrSixteenOrNone) {
  EXPECT_THAT(complaint(std::string(kHead) + R"("clips":[{"markers":{"count":12}}]})"),
              HasSubstr("markers.count: expected 0, 8 or 16"));
  const SynthSuite suite =
      read(std::string(kHead) + R"("clips":[{"markers":{"count":8,"blue":0.5}},{"name":"bare"}]})");
  EXPECT_EQ(suite.clips[0].markers.count, 8);
  EXPECT_EQ(suite.clips[0].markers.blue, 0.5);
  EXPECT_EQ(suite.clips[1].markers.count, 0);
}

}  // namespace
}  // namespace semblance
