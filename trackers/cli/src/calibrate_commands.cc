// `semblance calibrate`: sheets found in pictures, sheets to print.
#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "semblance/cameras/print_sheet.h"
#include "semblance/cameras/sheet_pictures.h"
#include "semblance/core/errors.h"
#include "semblance/core/progress.h"

namespace semblance::cli {

namespace {

nlohmann::ordered_json json_of(const SheetPictures& pictures, std::size_t index) {
  const Detection& detection = pictures.detections[index];
  nlohmann::ordered_json json;
  json["file"] = pictures.names[index].file;
  if (pictures.names[index].frame >= 0) json["frame"] = pictures.names[index].frame;
  json["size_px"] = {detection.width, detection.height};
  json["ids"] = detection.ids;
  json["points_px"] = nlohmann::json::array();
  for (Eigen::Index i = 0; i < detection.points_px.cols(); ++i) {
    json["points_px"].push_back({detection.points_px(0, i), detection.points_px(1, i)});
  }
  if (detection.inverted) json["inverted"] = true;
  json["warnings"] = nlohmann::json::array();
  for (const DetectionWarning& warning : detection.warnings) {
    json["warnings"].push_back({{"name", warning_name(warning.kind)}, {"text", warning.text}});
  }
  return json;
}

struct DetectOptions {
  std::vector<std::string> files;
  std::string target;
};

void run_detect(const Context& context, const DetectOptions& options) {
  const Target asked = parse_target(options.target);
  const auto progress = console_progress();
  const SheetPictures pictures = find_sheet(options.files, asked, 0, *progress);
  if (asked.kind == TargetKind::automatic) {
    fmt::print("sheet: {}{}\n", target_text(pictures.target),
               asked.size_m > 0.0 ? "" : " (a picture tells no sizes: 1 m is assumed)");
  }
  const std::size_t points = point_ids(pictures.target).size();
  nlohmann::ordered_json summary;
  summary["target"] = target_text(pictures.target);
  summary["points_of_sheet"] = points;
  summary["pictures"] = pictures.names.size();
  summary["found"] = pictures.found();
  summary["detect_s"] = pictures.detect_s;
  summary["images"] = nlohmann::json::array();
  for (std::size_t i = 0; i < pictures.names.size(); ++i) {
    const Detection& detection = pictures.detections[i];
    fmt::print("{}: {} of {} points\n", pictures.names[i].text(), detection.ids.size(), points);
    for (const DetectionWarning& warning : detection.warnings) {
      fmt::print("  {}: {}\n", warning_name(warning.kind), warning.text);
    }
    summary["images"].push_back(json_of(pictures, i));
  }
  write_summary(context, summary.dump(1));
  fmt::print("{} of {} pictures show the sheet; {:.1f} ms a picture\n", pictures.found(),
             pictures.names.size(),
             1e3 * pictures.detect_s / static_cast<double>(pictures.names.size()));
}

void add_detect(CLI::App& calibrate, Context& context) {
  CLI::App* detect = calibrate.add_subcommand(
      "detect", "Find a sheet's points in pictures (PNG, JPEG), videos or folders of pictures");
  auto options = std::make_shared<DetectOptions>();
  detect->add_option("pictures", options->files, "Pictures, videos, folders")->required();
  detect
      ->add_option("--target", options->target,
                   "The sheet, as in chessboard:9x6:0.025, charuco:4x5:0.054:DICT_4X4_1000, "
                   "aprilgrid:6x6:0.088:0.3:border2, circles:4x11:0.02:asymmetric, dots:13x9:0.02, "
                   "auto")
      ->required()
      ->check(sheet_name());
  detect->callback([&context, options] {
    context.action = [&context, options] { run_detect(context, *options); };
  });
}

void add_print(CLI::App& calibrate, Context& context) {
  CLI::App* print =
      calibrate.add_subcommand("print", "Draw a sheet at true scale as PDF or SVG, with a ruler");
  struct PrintOptions {
    std::string target, paper = "a4", output;
  };
  auto options = std::make_shared<PrintOptions>();
  print->add_option("--target", options->target, "The sheet, as for `calibrate detect`")
      ->required()
      ->check(sheet_name());
  print->add_option("--paper", options->paper, "Size of the paper, upright or lying as needed")
      ->check(CLI::IsMember(paper_names()))
      ->capture_default_str();
  print->add_option("-o,--output", options->output, "The drawing: .pdf or .svg")
      ->required()
      ->check([](const std::string& path) {
        const std::string extension = std::filesystem::path(path).extension().string();
        return extension == ".pdf" || extension == ".svg"
                   ? std::string()
                   : path + ": sheets are written as .pdf or .svg";
      });
  print->callback([&context, options] {
    context.action = [options] {
      print_sheet(parse_target(options->target), options->paper, options->output);
    };
  });
}

}  // namespace

CLI::Validator sheet_name() {
  return CLI::Validator(
      [](const std::string& text) {
        try {
          parse_target(text);
          return std::string();
        } catch (const InvalidInput& error) {
          return std::string(error.what());
        }
      },
      "SHEET");
}

void add_calibrate_commands(CLI::App& app, Context& context) {
  CLI::App* calibrate = app.add_subcommand("calibrate", "Cameras: sheets, calibration and files");
  calibrate->require_subcommand(1);
  add_detect(*calibrate, context);
  add_print(*calibrate, context);
  add_calibrate_board_command(*calibrate, context);
  add_calibrate_rig_command(*calibrate, context);
  add_calibrate_markers_command(*calibrate, context);
  add_calibrate_photos_command(*calibrate, context);
  add_calibrate_object_command(*calibrate, context);
  add_calibrate_judge_command(*calibrate, context);
  add_calibrate_convert_command(*calibrate, context);
}

}  // namespace semblance::cli
