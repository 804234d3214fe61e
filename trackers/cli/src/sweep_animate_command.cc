#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "semblance/models/mouth_visemes.h"
#include "semblance/pipeline/mouth_animation.h"

namespace semblance::cli {

namespace {

/// Options as the parser fills them; lists become the library's figures afterwards.
struct AnimateArguments {
  MouthAnimationOptions options;
  std::vector<double> reference, radial, tangential, fibres;
  int budget = 0;
  bool linear = false;
};

void set_scaling(const std::vector<double>& list, PathControls& controls) {
  if (list.empty()) return;
  controls.alpha = list[0], controls.beta = list[1];
  controls.gamma = list[2], controls.delta = list[3];
}

MouthAnimationOptions complete_options(const AnimateArguments& arguments) {
  MouthAnimationOptions options = arguments.options;
  if (arguments.budget > 0) options.choice.most_keys = arguments.budget;
  if (!arguments.reference.empty()) {
    options.choice.reference_px = Eigen::Vector2d(arguments.reference[0], arguments.reference[1]);
  }
  set_scaling(arguments.radial, options.choice.controls.radial);
  set_scaling(arguments.tangential, options.choice.controls.tangential);
  if (!arguments.fibres.empty()) {
    options.wireframe.fibres = {arguments.fibres[0], arguments.fibres[1]};
  }
  if (arguments.linear) options.wireframe.between = MouthWireframeOptions::Between::linear;
  return options;
}

nlohmann::json summary_json(const MouthAnimationSummary& summary) {
  nlohmann::json keys = nlohmann::json::array();
  for (const AnimatedKey& key : summary.keys) {
    keys.push_back({{"frame", key.frame}, {"time_s", key.time_s}, {"viseme", key.viseme}});
  }
  return {{"keys", keys},
          {"frames", summary.frames},
          {"frames_per_second", summary.frames_per_second},
          {"compared_frames", summary.error.frames},
          {"rms_px", summary.error.rms_px},
          {"worst_px", summary.error.worst_px},
          {"worst_frame", summary.error.worst_frame},
          {"total_s", summary.total_s}};
}

void run_animate(const Context& context, const AnimateArguments& arguments) {
  const MouthAnimationOptions options = complete_options(arguments);
  const auto progress = console_progress();
  const MouthAnimationSummary summary = animate_mouth(options, *progress);
  fmt::print("{} key frames, {} frames at {:g} per second; {:.1f} s\n", summary.keys.size(),
             summary.frames, summary.frames_per_second, summary.total_s);
  if (summary.error.frames > 0) {
    fmt::print("{} frames between the keys: markers off by {:.2f} px rms, {:.2f} px in frame {}\n",
               summary.error.frames, summary.error.rms_px, summary.error.worst_px,
               summary.error.worst_frame);
  }
  fmt::print("results in {}: animation.mp4 wireframe.mp4 animation.csv wireframe.json mouth.glb\n",
             options.folder);
  write_summary(context, summary_json(summary).dump(2));
}

}  // namespace

void add_sweep_animate_command(CLI::App& sweep, Context& context) {
  CLI::App* animate =
      sweep.add_subcommand("animate", "Move a mouth through key frames of its lip markers");
  auto arguments = std::make_shared<AnimateArguments>();
  MouthAnimationOptions& options = arguments->options;
  MarkerControls& controls = options.choice.controls;
  animate->add_option("markers", options.markers, "Table of lip markers (docs/formats/lips.md)")
      ->required();
  animate->add_option("-o,--output", options.folder, "Folder for the results")->required();
  CLI::Option* video =
      animate->add_option("--video", options.video, "Video that the markers were tracked in");
  animate
      ->add_option("--still", options.still_frame,
                   "Take all texture from this frame instead of blending one key into the next")
      ->needs(video);
  CLI::Option* keys =
      animate->add_option("--keys", options.keys, "Numbers of the key frames: 0,12,30")
          ->delimiter(',');
  animate->add_option("--budget", arguments->budget, "Choose at most this many key frames")
      ->check(CLI::Range(2, 1000000))
      ->excludes(keys);
  animate
      ->add_option("--tolerance", options.choice.tolerance_px,
                   "Choose key frames until no other is off by more pixels")
      ->check(CLI::NonNegativeNumber)
      ->excludes(keys)
      ->capture_default_str();
  animate
      ->add_option("--neighbours", options.choice.neighbours,
                   "Frames on either side that give velocities; 0: those of the table")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str();
  animate->add_option("--visemes", options.visemes,
                      "Scanned mouths for the depth (docs/formats/visemes.md)");
  animate->add_option("-n", controls.radial.n, "Blend of the radial part, above -1");
  animate->add_option("-m", controls.tangential.n, "Blend of the tangential part, above -1");
  animate->add_option("-p", controls.depth_blend, "Blend of the depth, above -1");
  animate
      ->add_option("--radial", arguments->radial,
                   "Scaling of the radial part: alpha,beta,gamma,delta (.5,1,.5,1)")
      ->delimiter(',')
      ->expected(4);
  animate
      ->add_option("--tangential", arguments->tangential,
                   "Scaling of the tangential part: alpha,beta,gamma,delta (.5,1,.5,1)")
      ->delimiter(',')
      ->expected(4);
  animate
      ->add_option("--reference", arguments->reference,
                   "Reference point X,Y in pixels (default: on the axis of each first key's mouth)")
      ->delimiter(',')
      ->expected(2);
  animate
      ->add_option("--fibres", arguments->fibres,
                   "Places of the two middle contours between the lips' edges (1/3,2/3)")
      ->delimiter(',')
      ->expected(2);
  animate->add_flag("--linear", arguments->linear,
                    "Straight lines between the markers instead of a smooth contour");
  animate->add_option("--fps", options.frames_per_second, "Frames per second of the animation")
      ->check(CLI::PositiveNumber);
  animate->callback([&context, arguments] {
    context.action = [&context, arguments] { run_animate(context, *arguments); };
  });

  CLI::App* visemes = sweep.add_subcommand(
      "visemes", "Write the built-in face's visemes, to be replaced by scanned ones");
  auto path = std::make_shared<std::string>();
  visemes->add_option("file", *path, "visemes.json to write")->required();
  visemes->callback(
      [&context, path] { context.action = [path] { write_visemes(*path, builtin_visemes()); }; });
}

}  // namespace semblance::cli
