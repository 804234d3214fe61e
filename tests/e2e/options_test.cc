// What the options of `track face` promise, on a short generated clip with known truth.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "program.h"
#include "semblance/io/points.h"
#include "semblance/io/track_file.h"
#include "semblance/optim/optimizer.h"
#include "semblance/synth/score.h"
#include "small_clip.h"
#include "support.h"

namespace semblance::testing {
namespace {

namespace fs = std::filesystem;

class Options : public ::testing::Test {
 protected:
  std::string out(const std::string& name) const { return (folder_.path() / name).string(); }
  ProgramResult track(const std::string& name, std::vector<std::string> more = {}) const {
    const ClipFiles clip = small_clip();
    more.insert(more.begin(),
                {"track", "face", clip.video, "--camera", clip.camera, "-o", out(name)});
    return run_program(more);
  }
  Track result(const std::string& name) const { return read_track(out(name) + "/track.jsonl"); }

 private:
  TemporaryFolder folder_;
};

/// Mean distance of the 68 landmarks from the truth, in percent of the outer eye corners' distance.
double landmark_error_percent(const TrackFrame& frame, const TrackFrame& truth) {
  double sum = 0.0;
  for (std::size_t i = 0; i < 68; ++i) {
    sum += (frame.landmarks_px.at(i) - truth.landmarks_px.at(i)).norm();
  }
  const double eyes = (truth.landmarks_px[45] - truth.landmarks_px[36]).norm();
  return 100.0 * sum / 68.0 / eyes;
}

TEST_F(Options, AllResultsAreThere) {
  const std::string summary_path = out("summary.json");
  const ProgramResult run = track("out", {"--json", summary_path});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  for (const char* name : {"track.jsonl", "track.csv", "overlay.mp4", "face.glb", "report.html"}) {
    EXPECT_GT(fs::file_size(fs::path(out("out")) / name), 0u) << name;
  }
  const auto summary = nlohmann::json::parse(file_bytes(summary_path));
  EXPECT_EQ(summary["frames"], kSmallClipFrames);
  EXPECT_EQ(summary["tracked"], kSmallClipFrames);
  EXPECT_EQ(summary["lost"], 0);
  const SuiteScore score =
      score_tracks({read_scored_clip("small", out("out") + "/track.jsonl", small_clip().truth)});
  EXPECT_EQ(score.overall.unflagged, 0);
  EXPECT_LT(score.overall.landmarks_absolute_percent.visible_68.median, 6.0);
}

TEST_F(Options, BytesDoNotDependOnThreads) {
  ASSERT_EQ(track("one", {"--threads", "1"}).exit_code, 0);
  ASSERT_EQ(track("two", {"--threads", "2"}).exit_code, 0);
  for (const char* name : {"track.jsonl", "track.csv", "overlay.mp4", "face.glb"}) {
    const std::string bytes = file_bytes(fs::path(out("one")) / name);
    EXPECT_FALSE(bytes.empty()) << name;
    EXPECT_TRUE(bytes == file_bytes(fs::path(out("two")) / name)) << name << " differs";
  }
}

TEST_F(Options, SmoothGivesOneEstimatePerFrame) {
  const ProgramResult run = track("out", {"--smooth"});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const Track smooth = result("out"), truth = read_track(small_clip().truth);
  ASSERT_EQ(smooth.frames.size(), static_cast<std::size_t>(kSmallClipFrames));
  for (const TrackFrame& frame : smooth.frames) {
    ASSERT_NE(frame.status, TrackStatus::lost) << frame.frame;
    EXPECT_TRUE(frame.x.allFinite());
    EXPECT_TRUE((frame.sigma.array() >= 0.0 || frame.sigma.array().isNaN()).all());
    EXPECT_LT(landmark_error_percent(frame, truth.frames[static_cast<std::size_t>(frame.frame)]),
              10.0)
        << frame.frame;
  }
  EXPECT_FALSE(fs::exists(fs::path(out("out")) / "track.smooth.partial"));
}

TEST_F(Options, PointsChooseWhereToStart) {
  const Track truth = read_track(small_clip().truth);
  const std::string marks = out("marks.pts");
  write_points(marks, truth.frames.at(0).landmarks_px);
  const ProgramResult run = track("out", {"--points", marks, "--last-frame", "2"});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const Track marked = result("out");
  ASSERT_EQ(marked.frames.size(), 3u);
  ASSERT_EQ(marked.frames[0].status, TrackStatus::tracked);
  EXPECT_LT(landmark_error_percent(marked.frames[0], truth.frames[0]), 6.0);
}

class EveryOptimizer : public Options, public ::testing::WithParamInterface<std::string> {};

TEST_P(EveryOptimizer, TracksTheFirstFrames) {
  const ProgramResult run =
      track("out", {"--optimizer", GetParam(), "--last-frame", "3", "--no-overlay"});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const Track track = result("out"), truth = read_track(small_clip().truth);
  ASSERT_EQ(track.frames.size(), 4u);
  for (const TrackFrame& frame : track.frames) {
    ASSERT_EQ(frame.status, TrackStatus::tracked) << frame.frame;
    EXPECT_LT(landmark_error_percent(frame, truth.frames[static_cast<std::size_t>(frame.frame)]),
              10.0)
        << frame.frame;
  }
}

INSTANTIATE_TEST_SUITE_P(All, EveryOptimizer, ::testing::ValuesIn(optimizer_names()),
                         [](const auto& info) { return info.param; });

}  // namespace
}  // namespace semblance::testing
