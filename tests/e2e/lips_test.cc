// Markers on the lips of a generated face: tracked by the program, compared with the exact truth.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "program.h"
#include "semblance/io/lip_markers.h"
#include "semblance/io/track_file.h"
#include "semblance/io/video.h"
#include "semblance/synth/generate.h"
#include "semblance/synth/score_lips.h"
#include "support.h"

namespace semblance::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

/// A mouth that fills the picture, with noise and blur, finger tips before half of it, then a hand
/// before all of it.
FaceClipSpec mouth_clip() {
  FaceClipSpec spec;
  spec.name = "mouth";
  spec.seed = 11;
  spec.density = 1.2;
  spec.frames = 64;
  spec.width = 320;
  spec.height = 240;
  spec.focal_px = 1100.0;
  spec.motion.height_m = 0.075;
  spec.motion.yaw_deg = 6.0;
  spec.motion.pitch_deg = 4.0;
  spec.motion.roll_deg = 4.0;
  spec.motion.distance_m = 0.5;
  spec.motion.distance_range_m = 0.01;
  spec.motion.sideways_m = 0.005;
  spec.occlusion.fingers_from_s = 0.7;
  spec.occlusion.fingers_to_s = 0.8;
  spec.occlusion.hand_from_s = 1.7;
  spec.occlusion.hand_to_s = 1.8;
  spec.look.clutter = false;
  spec.look.stubble = 0.0;
  spec.markers.count = 16;
  return spec;
}

ProgramResult track_lips(const fs::path& video, const fs::path& out,
                         std::vector<std::string> more = {}) {
  more.insert(more.begin(), {"track", "lips", video.string(), "-o", out.string()});
  return run_program(more);
}

TEST(Lips, MarkersOfAGeneratedFaceAreWhereTheyWerePainted) {
  const TemporaryFolder folder;
  const ClipFiles clip = generate_clip(mouth_clip(), (folder.path() / "clips/mouth").string());
  const fs::path out = folder.path() / "results/mouth";
  fs::create_directories(out.parent_path());
  const ProgramResult run =
      track_lips(clip.video, out, {"--json", (folder.path() / "summary.json").string()});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  for (const char* name : {"track.jsonl", "lips.csv", "overlay.mp4", "report.html"}) {
    EXPECT_FALSE(file_bytes(out / name).empty()) << name;
  }
  const LipTrack truth = read_lip_markers((folder.path() / "clips/mouth/lips.csv").string());
  const LipTrack track = read_lip_markers((out / "lips.csv").string());
  const LipScore score = score_lips("mouth", track, truth);
  EXPECT_LT(score.seen_px.median, 0.3);
  EXPECT_LT(score.seen_px.p95, 0.8);
  EXPECT_EQ(score.swapped, 0);
  EXPECT_EQ(score.invented, 0);
  EXPECT_GT(score.seen, 0.85 * score.visible);
  EXPECT_GT(score.bridged, 0);
  EXPECT_GT(score.lost_frames, 0);
  // Found again after the hand.
  EXPECT_EQ(track.frames.back().markers[2].state, MarkerState::seen);
  const Track lines = read_track((out / "track.jsonl").string());
  EXPECT_EQ(lines.header["kind"], "lips");
  EXPECT_EQ(lines.frames.size(), 64u);
  EXPECT_THAT(file_bytes(out / "report.html"), HasSubstr("Mouth opening"));
  EXPECT_THAT(file_bytes(folder.path() / "summary.json"), HasSubstr("tracking_frames_per_second"));
  // The table that a user gets says the same.
  const ProgramResult table = run_program({"score", (folder.path() / "clips").string(),
                                           (folder.path() / "results").string(), "--lips"});
  EXPECT_EQ(table.exit_code, 0);
  EXPECT_THAT(table.output, HasSubstr("swapped"));

  // Stopped half way and resumed, and with other threads: the same bytes.
  const fs::path halves = folder.path() / "halves";
  ASSERT_EQ(track_lips(clip.video, halves, {"--last-frame", "20", "--threads", "1"}).exit_code, 0);
  ASSERT_EQ(track_lips(clip.video, halves, {"--resume", "--threads", "1"}).exit_code, 0);
  for (const char* name : {"track.jsonl", "lips.csv", "overlay.mp4"}) {
    EXPECT_TRUE(file_bytes(out / name) == file_bytes(halves / name)) << name << " differs";
  }
}

}  // namespace
}  // namespace semblance::testing
