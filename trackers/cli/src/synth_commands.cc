#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>

#include "commands.h"
#include "semblance/core/errors.h"
#include "semblance/core/progress.h"
#include "semblance/synth/generate.h"
#include "semblance/synth/score.h"
#include "semblance/synth/score_lips.h"

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

/// Names of the clips under `truth`, in order.
std::vector<std::string> clip_names(const std::string& truth) {
  std::vector<std::string> names;
  std::error_code error;
  fs::directory_iterator entries(truth, error);
  if (error) {
    throw IoError(truth + ": cannot be listed (" + error.message() +
                  "); give the folder that `semblance synth` wrote");
  }
  for (const fs::directory_entry& entry : entries) {
    if (fs::exists(entry.path() / "truth.jsonl")) names.push_back(entry.path().filename().string());
  }
  if (names.empty()) {
    throw InvalidInput(truth +
                       ": no clip with a truth.jsonl in it; give the folder that `semblance "
                       "synth` wrote");
  }
  std::sort(names.begin(), names.end());
  return names;
}

/// DIR/<clip>/lips.csv under `results` against DIR/<clip>/lips.csv under `truth`.
void run_score_lips(const Context& context, const fs::path& truth, const fs::path& results) {
  std::vector<LipScore> clips;
  for (const std::string& name : clip_names(truth.string())) {
    clips.push_back(score_lips(name, read_lip_markers((results / name / "lips.csv").string()),
                               read_lip_markers((truth / name / "lips.csv").string())));
  }
  fmt::print("{}", lip_score_table(clips));
  write_summary(context, lip_score_json(clips));
}

/// DIR/<clip>/track.jsonl under `results` against DIR/<clip>/truth.jsonl under `truth`.
void run_score(const Context& context, const fs::path& truth, const fs::path& results) {
  std::vector<ScoredClip> clips;
  for (const std::string& name : clip_names(truth.string())) {
    clips.push_back(read_scored_clip(name, (results / name / "track.jsonl").string(),
                                     (truth / name / "truth.jsonl").string()));
  }
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
  auto lips = std::make_shared<bool>(false);
  score->add_flag("--lips", *lips, "Compare the lips' markers (lips.csv) instead of the face");
  score->callback([&context, scored, lips] {
    context.action = [&context, scored, lips] {
      const auto run = *lips ? run_score_lips : run_score;
      run(context, scored->input, scored->output);
    };
  });
}

}  // namespace semblance::cli
