// `semblance sweep reconstruct` and `sweep restore`.
#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "scan_options.h"

namespace semblance::cli {

namespace {

using nlohmann::ordered_json;

struct ReconstructArguments {
  ReconstructionOptions options;
  double error_scale_mm = 1.0;
  bool compare = false;
  std::vector<int> compare_contours{26, 52, 78, 103};
};

struct RestoreArguments {
  std::string stored;
  ReconstructionFiles files;
};

ordered_json error_json(const RadialError& error) {
  return {{"mean_m", error.mean_m},
          {"rms_m", error.rms_m},
          {"percentile95_m", error.percentile95_m},
          {"largest_m", error.largest_m}};
}

ordered_json comparison_json(const std::vector<ScanComparison>& rows) {
  ordered_json list = ordered_json::array();
  for (const ScanComparison& row : rows) {
    list.push_back({{"method", row.method},
                    {"budget_numbers", row.budget_numbers},
                    {"numbers", row.numbers},
                    {"contours", row.contours},
                    {"error", error_json(row.error)},
                    {"store_s", row.store_s},
                    {"restore_s", row.restore_s}});
  }
  return list;
}

void print_swept(const SweptScan& swept) {
  const auto samples = static_cast<double>(swept.rows * swept.columns);
  fmt::print("stored: {:.1f} contours in the mean, {} numbers ({:.1f} % of the map's)\n",
             swept.contours, swept.numbers, 100.0 * static_cast<double>(swept.numbers) / samples);
  fmt::print("swept in {:.1f} ms\n", 1e3 * swept.restore_s);
  if (swept.void_samples > 0) {
    fmt::print("{} samples came out beyond the axis and are void\n", swept.void_samples);
  }
}

ordered_json swept_json(const SweptScan& swept) {
  return {{"rows", swept.rows},
          {"columns", swept.columns},
          {"contours", swept.contours},
          {"numbers", swept.numbers},
          {"void_samples", swept.void_samples},
          {"restore_s", swept.restore_s}};
}

void run_reconstruct(const Context& context, const ReconstructArguments& arguments) {
  ReconstructionOptions options = arguments.options;
  options.error_scale_m = 1e-3 * arguments.error_scale_mm;
  if (arguments.compare) options.compare_contours = arguments.compare_contours;
  const ReconstructionSummary summary = reconstruct_scan(options);
  const RadialError& error = summary.error;
  fmt::print("scan: {} rows x {} columns, {} filled, mean radius {:.2f} mm\n", summary.swept.rows,
             summary.swept.columns, summary.filled_samples, 1e3 * summary.mean_radius_m);
  print_swept(summary.swept);
  fmt::print(
      "radial error: mean {:.4f} mm ({:.3f} % of the mean radius), 95 % {:.4f} mm, largest {:.3f} "
      "mm\n{}/stored.json: {} bytes\n",
      1e3 * error.mean_m, 100.0 * error.mean_m / summary.mean_radius_m, 1e3 * error.percentile95_m,
      1e3 * error.largest_m, options.files.folder, summary.file_bytes);
  if (arguments.compare) fmt::print("\n{}", comparison_table(summary.comparison));
  ordered_json json = swept_json(summary.swept);
  json["filled_samples"] = summary.filled_samples;
  json["mean_radius_m"] = summary.mean_radius_m;
  json["error"] = error_json(error);
  json["stored_bytes"] = summary.file_bytes;
  if (arguments.compare) json["comparison"] = comparison_json(summary.comparison);
  write_summary(context, json.dump(2));
}

void run_restore(const Context& context, const RestoreArguments& arguments) {
  const SweptScan swept = restore_scan(arguments.stored, arguments.files);
  print_swept(swept);
  write_summary(context, swept_json(swept).dump(2));
}

void add_files(CLI::App& command, ReconstructionFiles& files) {
  command.add_option("-o,--output", files.folder, "Folder for the results")->required();
  add_encoding_option(command, files.encoding);
  command.add_option("--picture", files.picture, "Shaded views of the result, PNG or JPEG");
}

void add_method_options(CLI::App& command, StorageOptions& options) {
  command
      .add_option("--method", options.method,
                  "null, one-sided, averaged (figures 17, 19, 20 of the report), fitted (averaged "
                  "tangents, n by least squares) or full (full)")
      ->transform(CLI::CheckedTransformer(
          std::map<std::string, StorageMethod>{{"null", StorageMethod::null},
                                               {"one-sided", StorageMethod::one_sided},
                                               {"averaged", StorageMethod::averaged},
                                               {"fitted", StorageMethod::fitted},
                                               {"full", StorageMethod::full}}));
  command
      .add_option("--form", options.form,
                  "Of the methods but full: single (the report's static form) or double scaling, "
                  "which is more accurate (double)")
      ->transform(CLI::CheckedTransformer(std::map<std::string, SweepForm>{
          {"single", SweepForm::single_scaling}, {"double", SweepForm::double_scaling}}));
  command
      .add_option("--fit", options.share, "Of fitted: one n per pair of contours or profile (pair)")
      ->transform(CLI::CheckedTransformer(std::map<std::string, BlendShare>{
          {"pair", BlendShare::pair}, {"profile", BlendShare::profile}}));
  command
      .add_option("-n,--blend", options.n,
                  "Blending parameter n > -1 of the methods null, one-sided and averaged")
      ->capture_default_str();
  CLI::Option* every =
      command.add_option("--every", options.every, "Store one contour in so many rows")
          ->capture_default_str();
  command
      .add_option("--budget", options.budget_contours,
                  "Instead of --every: store at most the numbers of so many contours")
      ->check(CLI::Range(1, static_cast<int>(most_range_samples_per_side)))
      ->excludes(every);
  command
      .add_option("--panel-columns", options.panel_columns,
                  "Of full: columns that share the places of their contours")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
}

void add_comparison_options(CLI::App& command, ReconstructArguments& arguments) {
  command
      .add_option("--error-scale-mm", arguments.error_scale_mm,
                  "Radial error of full colour in errors.png")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  CLI::Option* compare =
      command.add_flag("--compare", arguments.compare,
                       "Table of sweeps, splines and decimated meshes at equal numbers stored");
  command
      .add_option("--compare-budgets", arguments.compare_contours,
                  "Contours' worth of numbers for --compare")
      ->check(CLI::Range(6, static_cast<int>(most_range_samples_per_side)))
      ->needs(compare)
      ->capture_default_str();
}

/// Refuses options that would have no effect: of other methods, and of meshes for a range map.
void require_effect(const CLI::App& command, const ReconstructionOptions& options) {
  const StorageMethod method = options.storage.method;
  const auto refuse = [&](const char* name, const std::string& with) {
    if (command[name]->count() > 0) throw CLI::ExcludesError(name, with);
  };
  if (is_range_map(options.input)) {
    for (const char* name :
         {"--unit-m", "--columns", "--rows", "--axis-point", "--up", "--front"}) {
      refuse(name, "a range map, which is scanned already");
    }
  }
  if (method == StorageMethod::full) refuse("--form", "--method full");
  if (method != StorageMethod::full) refuse("--panel-columns", "other methods than full");
  if (method != StorageMethod::fitted) refuse("--fit", "other methods than fitted");
  if (method == StorageMethod::full || method == StorageMethod::fitted) {
    refuse("--blend", "a method that chooses n");
  }
}

}  // namespace

void add_sweep_reconstruct_command(CLI::App& sweep, Context& context) {
  auto arguments = std::make_shared<ReconstructArguments>();
  ReconstructionOptions& options = arguments->options;
  CLI::App* command = sweep.add_subcommand(
      "reconstruct", "Store a scan as few contours and sweep it back between them");
  command->add_option("input", options.input, "Mesh (.obj, .ply) or range map (.json)")->required();
  add_files(*command, options.files);
  add_scan_options(*command, options.mesh);
  add_method_options(*command, options.storage);
  add_comparison_options(*command, *arguments);
  command->callback([&context, command, arguments] {
    require_effect(*command, arguments->options);
    context.action = [&context, arguments] { run_reconstruct(context, *arguments); };
  });

  auto restore = std::make_shared<RestoreArguments>();
  command = sweep.add_subcommand("restore", "Sweep back what reconstruct has stored");
  command->add_option("stored", restore->stored, "stored.json (docs/formats/radial_sweep.md)")
      ->required();
  add_files(*command, restore->files);
  command->callback([&context, restore] {
    context.action = [&context, restore] { run_restore(context, *restore); };
  });
}

}  // namespace semblance::cli
