// `semblance calibrate`: sheets found in pictures, sheets to print.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "semblance/cameras/detect.h"
#include "semblance/cameras/print_sheet.h"
#include "semblance/core/errors.h"
#include "semblance/io/image_io.h"
#include "semblance/io/video.h"

namespace semblance::cli {

namespace {

constexpr std::size_t kEnoughIdentified = 5;  // pictures that show the sheet of `auto`
constexpr int kMostLookedAt = 60;

/// A picture and where it is from; `frame` is -1 for a still.
struct Picture {
  std::string file;
  int frame = -1;
  Rgb8 image;

  std::string name() const { return frame < 0 ? file : fmt::format("{} frame {}", file, frame); }
};

bool is_still(const std::string& path) {
  std::string extension = std::filesystem::path(path).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension == ".png" || extension == ".jpg" || extension == ".jpeg";
}

/// Hands every picture to `use`, until it returns false. Videos and folders give their frames.
void for_each_picture(const std::vector<std::string>& files,
                      const std::function<bool(const Picture&)>& use) {
  for (const std::string& file : files) {
    if (is_still(file)) {
      if (!use({file, -1, read_image_rgb8(file)})) return;
      continue;
    }
    VideoSource video(file);
    Picture picture{file, 0, {}};
    for (; video.next(picture.image); ++picture.frame) {
      if (!use(picture)) return;
    }
  }
}

Target identify(const std::vector<std::string>& files, const Target& automatic) {
  std::vector<Rgb8> images;
  int looked_at = 0;
  for_each_picture(files, [&](const Picture& picture) {
    if (identify_target({picture.image}, automatic).kind != TargetKind::automatic) {
      images.push_back(picture.image);
    }
    return images.size() < kEnoughIdentified && ++looked_at < kMostLookedAt;
  });
  return identify_target(images, automatic);
}

nlohmann::ordered_json json_of(const Picture& picture, const Detection& detection) {
  nlohmann::ordered_json json;
  json["file"] = picture.file;
  if (picture.frame >= 0) json["frame"] = picture.frame;
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

/// What to say where no picture shows the sheet: perhaps they show another.
std::string nothing_found(const DetectOptions& options, const Target& target) {
  std::string text = fmt::format("no picture shows the sheet {}", options.target);
  if (target.kind == TargetKind::automatic) return text + " (no sheet of a known kind is seen)";
  const Target seen = identify(options.files, {});
  if (seen.kind == TargetKind::automatic) return text + ", nor another one of a known kind";
  return fmt::format("{}: they seem to show {} (its size is not known: give yours for 1)", text,
                     target_text(seen));
}

void run_detect(const Context& context, const DetectOptions& options) {
  Target target = parse_target(options.target);
  const bool automatic = target.kind == TargetKind::automatic;
  if (automatic) {
    const Target found = identify(options.files, target);
    if (found.kind == TargetKind::automatic) throw SolverError(nothing_found(options, target));
    fmt::print("sheet: {}{}\n", target_text(found),
               target.size_m > 0.0 ? "" : " (a picture tells no sizes: 1 m is assumed)");
    target = found;
  }
  Detector detector(target);
  nlohmann::ordered_json summary;
  summary["target"] = target_text(target);
  summary["points_of_sheet"] = point_ids(target).size();
  int pictures = 0, found = 0;
  double seconds = 0.0;
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for_each_picture(options.files, [&](const Picture& picture) {
    const auto start = std::chrono::steady_clock::now();
    const Detection detection = detector.detect(picture.image);
    seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    fmt::print("{}: {} of {} points\n", picture.name(), detection.ids.size(),
               point_ids(target).size());
    for (const DetectionWarning& warning : detection.warnings) {
      fmt::print("  {}: {}\n", warning_name(warning.kind), warning.text);
    }
    ++pictures;
    found += detection.found() ? 1 : 0;
    list.push_back(json_of(picture, detection));
    return true;
  });
  summary["pictures"] = pictures;
  summary["found"] = found;
  summary["detect_s"] = seconds;
  summary["images"] = std::move(list);
  write_summary(context, summary.dump(1));
  if (found == 0) throw SolverError(nothing_found(options, target));
  fmt::print("{} of {} pictures show the sheet; {:.1f} ms a picture\n", found, pictures,
             1e3 * seconds / pictures);
}

/// A wrong name of a sheet is wrong usage.
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

void add_calibrate_commands(CLI::App& app, Context& context) {
  CLI::App* calibrate = app.add_subcommand("calibrate", "Cameras: sheets, calibration and files");
  calibrate->require_subcommand(1);
  add_detect(*calibrate, context);
  add_print(*calibrate, context);
  add_calibrate_convert_command(*calibrate, context);
}

}  // namespace semblance::cli
