#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "commands.h"
#include "semblance/core/progress.h"
#include "semblance/face/track_face.h"
#include "semblance/synth/generate.h"
#include "semblance/synth/score.h"

namespace semblance::cli {

namespace fs = std::filesystem;

namespace {

/// A talking, turning head by ray tracing at another tessellation, with blur, noise and clutter.
FaceClipSpec demo_clip() {
  FaceClipSpec spec;
  spec.name = "demo";
  spec.seed = 7;
  spec.frames = 100;
  spec.width = 480;
  spec.height = 360;
  spec.focal_px = 500.0;
  spec.motion.yaw_deg = 30.0;
  return spec;
}

void run_demo(const Context& context, const std::string& folder) {
  make_folder(folder);
  const auto progress = console_progress();
  fmt::print("1. generating a clip with known truth\n");
  const ClipFiles clip =
      generate_clip(demo_clip(), (fs::path(folder) / "clip").string(), *progress);
  fmt::print("2. tracking it\n");
  FaceTrackingOptions options;
  options.video = clip.video;
  options.camera = clip.camera;
  options.folder = (fs::path(folder) / "result").string();
  const FaceTrackingSummary summary = track_face(options, *progress);
  fmt::print("3. scoring it with the truth (same model on both sides: a sanity floor)\n\n");
  const SuiteScore score =
      score_tracks({read_scored_clip("demo", options.folder + "/track.jsonl", clip.truth)});
  fmt::print("{}\n{} of {} frames tracked, {:.1f} frames/s\n", score_table(score),
             summary.outcome.tracked, summary.outcome.frames, summary.frames_per_second);
  fmt::print("look at {0}/overlay.mp4 and {0}/report.html\n", options.folder);
  write_summary(context, score_json(score));
}

}  // namespace

void add_demo_command(CLI::App& app, Context& context) {
  auto folder = std::make_shared<std::string>("semblance-demo");
  CLI::App* demo = app.add_subcommand("demo", "Generate, track and score a short clip");
  demo->add_option("-o,--output", *folder, "Folder for clip and results")->capture_default_str();
  demo->callback(
      [&context, folder] { context.action = [&context, folder] { run_demo(context, *folder); }; });
}

}  // namespace semblance::cli
