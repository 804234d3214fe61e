#include <fmt/format.h>

#include <memory>

#include "commands.h"
#include "semblance/face/compare_optimizers.h"
#include "semblance/synth/generate.h"

namespace semblance::cli {

namespace {

void run_compare(const Context& context, CompareOptions options, const std::string& folder) {
  const ClipFiles files = clip_files(folder);
  options.video = files.video;
  options.camera = files.camera;
  options.truth = files.truth;
  const auto progress = console_progress();
  const OptimizerComparison comparison = compare_optimizers(options, *progress);
  fmt::print("{}", comparison_table(comparison));
  write_summary(context, comparison_json(comparison));
}

}  // namespace

void add_compare_command(CLI::App& app, Context& context) {
  CLI::App* compare = app.add_subcommand("compare", "Compare methods on the same problems");
  compare->require_subcommand(1);
  CLI::App* optimizers = compare->add_subcommand(
      "optimizers", "Every optimizer on frames of a synthetic clip, from the same starts");
  struct Choice {
    CompareOptions options;
    std::string folder;
  };
  auto choice = std::make_shared<Choice>();
  optimizers->add_option("clip", choice->folder, "A clip's folder, as `semblance synth` wrote it")
      ->required();
  optimizers->add_option("--frames", choice->options.frames, "How many frames")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  optimizers->add_option("--seed", choice->options.seed, "Seed of starts and random methods")
      ->capture_default_str();
  optimizers->add_option("--model", choice->options.model, "Face model to fit")
      ->capture_default_str();
  optimizers->callback([&context, choice] {
    context.action = [&context, choice] { run_compare(context, choice->options, choice->folder); };
  });
}

}  // namespace semblance::cli
