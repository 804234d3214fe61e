#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "semblance/face/track_face.h"
#include "semblance/lips/track_lips.h"
#include "semblance/optim/optimizer.h"

namespace semblance::cli {

namespace {

nlohmann::json summary_json(const FaceTrackingSummary& summary) {
  const TrackingOutcome& o = summary.outcome;
  return {{"frames", o.frames},
          {"tracked", o.tracked},
          {"lost", o.lost},
          {"reinitialised", o.reinitialised},
          {"cancelled", o.cancelled},
          {"focal_px", summary.focal_px},
          {"frames_per_second", summary.frames_per_second},
          {"warnings", summary.notes},
          {"decode_s", o.times.decode_s},
          {"track_s", o.times.track_s},
          {"total_s", o.times.total_s}};
}

void run_track_face(const Context& context, const FaceTrackingOptions& options) {
  const auto progress = console_progress();
  const FaceTrackingSummary summary = track_face(options, *progress);
  for (const std::string& note : summary.notes) fmt::print("warning: {}\n", note);
  const TrackingOutcome& o = summary.outcome;
  fmt::print("{}{} frames: {} tracked ({} found again), {} lost; {:.1f} frames/s, {:.1f} s\n",
             o.cancelled ? "interrupted after " : "", o.frames, o.tracked, o.reinitialised, o.lost,
             summary.frames_per_second, o.times.total_s);
  fmt::print("results in {}: track.jsonl track.csv{} face.glb report.html\n", options.folder,
             options.overlay ? " overlay.mp4" : "");
  if (o.cancelled) fmt::print("go on with the same command and --resume\n");
  if (summary.focal_sigma_px) {
    fmt::print("estimated focal length {:.0f} px, deviation {:.0f} px\n", summary.focal_px,
               *summary.focal_sigma_px);
  }
  write_summary(context, summary_json(summary).dump(2));
}

nlohmann::json number_or_null(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json();
}

/// Frames per second of the tracking alone: decoding and drawing run beside it or after it.
double tracking_rate(const TrackingOutcome& outcome) {
  return outcome.times.track_s > 0.0 ? outcome.frames / outcome.times.track_s : 0.0;
}

nlohmann::json summary_json(const LipTrackingSummary& summary) {
  const TrackingOutcome& o = summary.outcome;
  return {{"frames", o.frames},
          {"tracked", o.tracked},
          {"lost", o.lost},
          {"reinitialised", o.reinitialised},
          {"cancelled", o.cancelled},
          {"markers_seen", summary.seen},
          {"markers_bridged", summary.bridged},
          {"markers_absent", summary.absent},
          {"median_sigma_px", number_or_null(summary.median_sigma_px)},
          {"median_opening", number_or_null(summary.median_opening)},
          {"tracking_frames_per_second", tracking_rate(o)},
          {"decode_s", o.times.decode_s},
          {"track_s", o.times.track_s},
          {"total_s", o.times.total_s}};
}

void run_track_lips(const Context& context, const LipTrackingOptions& options) {
  const auto progress = console_progress();
  const LipTrackingSummary summary = track_lips(options, *progress);
  const TrackingOutcome& o = summary.outcome;
  fmt::print("{}{} frames: {} tracked ({} found again), {} lost; tracking alone {:.0f} frames/s\n",
             o.cancelled ? "interrupted after " : "", o.frames, o.tracked, o.reinitialised, o.lost,
             tracking_rate(o));
  fmt::print("markers: {} seen, {} bridged, {} absent\n", summary.seen, summary.bridged,
             summary.absent);
  fmt::print("results in {}: track.jsonl lips.csv{} report.html\n", options.folder,
             options.overlay ? " overlay.mp4" : "");
  if (o.cancelled) fmt::print("go on with the same command and --resume\n");
  write_summary(context, summary_json(summary).dump(2));
}

void add_track_lips(CLI::App& track, Context& context) {
  CLI::App* lips = track.add_subcommand("lips", "Track lips: painted dots, or those of a face");
  struct Choice {
    LipTrackingOptions options;
    std::string markers = "16";
  };
  auto choice = std::make_shared<Choice>();
  LipTrackingOptions& options = choice->options;
  lips->add_option("video", options.video, "Video file, or folder of images")->required();
  lips->add_option("-o,--output", options.folder, "Folder for the results")->required();
  lips->add_option("--markers", choice->markers,
                   "Dots painted on the lips: 8 (outer contour), 16 (and inner), or none")
      ->check(CLI::IsMember({"8", "16", "none"}))
      ->capture_default_str();
  lips->add_option("--velocity-frames", options.velocity_frames,
                   "Neighbours to each side that a velocity is taken from")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  lips->add_flag("--resume", options.resume, "Go on where an interrupted run stopped");
  lips->add_flag("!--no-overlay", options.overlay, "Do not write overlay.mp4");
  lips->add_option("--last-frame", options.last_frame, "Stop after this frame, counted from 0")
      ->check(CLI::NonNegativeNumber);
  lips->callback([&context, choice] {
    context.action = [&context, choice] {
      choice->options.markers = choice->markers == "none" ? 0 : std::stoi(choice->markers);
      run_track_lips(context, choice->options);
    };
  });
}

}  // namespace

void add_track_commands(CLI::App& app, Context& context) {
  CLI::App* track = app.add_subcommand("track", "Follow an object through a video");
  track->require_subcommand(1);
  add_track_lips(*track, context);
  CLI::App* face = track->add_subcommand("face", "Track a face: pose, expression, light");
  auto options = std::make_shared<FaceTrackingOptions>();
  face->add_option("video", options->video, "Video file, or folder of images")->required();
  face->add_option("-o,--output", options->folder, "Folder for the results")->required();
  face->add_option("--camera", options->camera, "Camera file (docs/formats/camera.md)");
  face->add_option("--focal", options->focal_px, "Focal length in pixels, without a camera file")
      ->check(CLI::PositiveNumber);
  face->add_flag("--estimate-focal", options->estimate_focal,
                 "Choose the focal length that explains the clip best");
  face->add_option("--model", options->model,
                   "builtin, an ICT FaceKit folder, a folder of OBJ shapes, or a glTF file")
      ->capture_default_str();
  face->add_option("--points", options->points, "68 points of the first frame (.pts or .json)");
  face->add_option("--face", options->face, "Which of several faces, from the left, from 0")
      ->check(CLI::NonNegativeNumber);
  face->add_option("--optimizer", options->optimizer, "Method of the frame loop")
      ->check(CLI::IsMember(optimizer_names()))
      ->capture_default_str();
  face->add_flag("--smooth", options->smooth, "Solve the whole clip again, in both directions");
  face->add_flag("--resume", options->resume, "Go on where an interrupted run stopped");
  face->add_flag("!--no-overlay", options->overlay, "Do not write overlay.mp4");
  face->add_option("--seed", options->seed, "Seed of the random methods")->capture_default_str();
  face->add_option("--last-frame", options->last_frame, "Stop after this frame, counted from 0")
      ->check(CLI::NonNegativeNumber);
  face->add_option("--checkpoint-every", options->checkpoint_every,
                   "Frames between the states that --resume can go on from")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  face->callback([&context, options] {
    context.action = [&context, options] { run_track_face(context, *options); };
  });
}

}  // namespace semblance::cli
