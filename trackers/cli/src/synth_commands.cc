#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "commands.h"
#include "semblance/core/errors.h"
#include "semblance/core/progress.h"
#include "semblance/synth/generate.h"
#include "semblance/synth/score.h"

namespace semblance::cli {

namespace fs = std::filesystem;

namespace {

void run_synth(const std::string& suite_path, const std::string& folder) {
  const SynthSuite suite = read_suite(suite_path);
  make_folder(folder);
  const auto progress = console_progress();
  for (const FaceClipSpec& spec : suite.clips) {
    const ClipFiles files = generate_clip(spec, (fs::path(folder) / spec.name).string(), *progress);
    fmt::print("{}\n", files.video);
  }
}

/// DIR/<clip>/track.jsonl under `results` against DIR/<clip>/truth.jsonl under `truth`.
void run_score(const Context& context, const std::string& truth, const std::string& results) {
  std::vector<ScoredClip> clips;
  std::error_code error;
  fs::directory_iterator entries(truth, error);
  if (error) {
    throw IoError(truth + ": cannot be listed (" + error.message() +
                  "); give the folder that `semblance synth` wrote");
  }
  for (const fs::directory_entry& entry : entries) {
    const std::string name = entry.path().filename().string();
    if (!fs::exists(entry.path() / "truth.jsonl")) continue;
    clips.push_back(read_scored_clip(name, (fs::path(results) / name / "track.jsonl").string(),
                                     (entry.path() / "truth.jsonl").string()));
  }
  if (clips.empty()) {
    throw InvalidInput(truth +
                       ": no clip with a truth.jsonl in it; give the folder that `semblance "
                       "synth` wrote");
  }
  std::sort(clips.begin(), clips.end(),
            [](const ScoredClip& a, const ScoredClip& b) { return a.name < b.name; });
  const SuiteScore score = score_tracks(clips);
  fmt::print("{}", score_table(score));
  write_summary(context, score_json(score));
}

}  // namespace

void add_synth_commands(CLI::App& app, Context& context) {
  struct Paths {
    std::string input, output;
  };
  auto generated = std::make_shared<Paths>();
  CLI::App* synth = app.add_subcommand("synth", "Generate a suite of clips with exact truth");
  synth->add_option("suite", generated->input, "suite.json, or its folder")->required();
  synth->add_option("-o,--output", generated->output, "Folder for the clips")->required();
  synth->callback([&context, generated] {
    context.action = [generated] { run_synth(generated->input, generated->output); };
  });

  auto scored = std::make_shared<Paths>();
  CLI::App* score = app.add_subcommand("score", "Compare tracks with the truth of a suite");
  score->add_option("truth", scored->input, "Folder that `semblance synth` wrote")->required();
  score->add_option("results", scored->output, "Folder with one result folder per clip")
      ->required();
  score->callback([&context, scored] {
    context.action = [&context, scored] { run_score(context, scored->input, scored->output); };
  });
}

}  // namespace semblance::cli
