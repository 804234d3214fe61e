// `semblance calibrate board` and `rig`: cameras from pictures of a sheet.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>

#include "calibration_results.h"
#include "commands.h"
#include "semblance/cameras/board_calibration.h"
#include "semblance/cameras/rig_calibration.h"
#include "semblance/cameras/sheet_pictures.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/core/progress.h"
#include "semblance/io/camera_formats.h"
#include "semblance/io/camera_io.h"

namespace semblance::cli {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct SheetOptions {
  std::vector<std::string> files;
  std::string target, lens = "brown5", folder;
  int most_frames = 200;
  bool square_pixels = false, centred = false, warp = false, keep_outliers = false;
};

struct RigCommandOptions : SheetOptions {
  std::string intrinsics;
  std::vector<std::string> kept_intrinsics, kept_poses;
  bool time_offsets = false;
};

std::vector<std::string> texts(const std::vector<PictureName>& names) {
  std::vector<std::string> result;
  for (const PictureName& name : names) result.push_back(name.text());
  return result;
}

void add_notes(const SheetPictures& pictures, std::vector<std::string>& notes) {
  std::map<std::string, int> counts;
  for (const Detection& detection : pictures.detections) {
    for (const DetectionWarning& warning : detection.warnings) ++counts[warning.text];
  }
  for (const auto& [text, count] : counts) {
    notes.push_back(count > 1 ? fmt::format("{} ({} pictures)", text, count) : text);
  }
}

/// A sheet whose size no one told: the shape of the result is right, its scale is not.
void note_size(const Target& asked, std::vector<std::string>& notes) {
  if (asked.kind == TargetKind::automatic && !(asked.size_m > 0.0)) {
    notes.emplace_back(
        "the sheet's size is not known: 1 m was assumed, and distances are in that unit; give it "
        "as in auto:0.025");
  }
}

BoardOptions board_options(const SheetOptions& options) {
  BoardOptions board;
  board.lens = *lens_from_name(options.lens);
  board.aspect = !options.square_pixels;
  board.principal = !options.centred;
  board.warp = options.warp;
  board.keep_outliers = options.keep_outliers;
  board.cancelled = [] { return interrupted(); };
  return board;
}

void run_board(const Context& context, const SheetOptions& options) {
  const auto progress = console_progress();
  const Target asked = parse_target(options.target);
  const SheetPictures pictures = find_sheet(options.files, asked, options.most_frames, *progress);
  const std::vector<std::string> names = texts(pictures.names);
  const BoardCalibration found =
      calibrate_board(pictures.detections, names, board_options(options));

  CalibrationReport report;
  report.title = fs::path(options.folder).filename().string();
  report.target = target_text(pictures.target);
  report.detect_s = pictures.detect_s;
  for (const Sighting& sighting : found.adjustment.survey.sightings) {
    const auto placement = static_cast<std::size_t>(sighting.placement);
    report.sighting_names.push_back(
        names[static_cast<std::size_t>(found.view_of_placement[placement])]);
  }
  note_size(asked, report.notes);
  add_notes(pictures, report.notes);
  Json outlier_views = Json::array();
  for (const BoardView& view : found.views) {
    if (view.points == 0 || 2 * view.outliers <= view.points) continue;
    outlier_views.push_back(view.name);
    report.notes.push_back(fmt::format(
        "{} does not fit the other pictures: {} of its {} points are outliers ({:.2f} px rms)",
        view.name, view.outliers, view.points, view.rms_px));
  }
  prepare_output_folder(options.folder);
  write_camera((fs::path(options.folder) / "camera.json").string(), found.camera);
  const Verdict verdict = finish_calibration(options.folder, found.adjustment, report, *progress);

  Json summary{{"target", report.target}, {"lens", options.lens}};
  summary.update(json_of(found.adjustment, verdict, 0));
  summary["rms_all_px"] = found.adjustment.rms_all_px;
  summary["outlier_views"] = std::move(outlier_views);
  summary["solve_s"] = found.adjustment.solve_s;
  summary["detect_s"] = pictures.detect_s;
  add_warnings(verdict, report, summary);
  write_summary(context, summary.dump(1));
  fmt::print("results in {}: camera.json report.html uncertainty_camera.svg\n", options.folder);
}

std::vector<RigCamera> known_cameras(const std::vector<std::string>& names,
                                     const RigCommandOptions& options) {
  std::vector<Camera> given;
  if (!options.intrinsics.empty()) {
    given = read_cameras(options.intrinsics, recognise_camera_file(options.intrinsics)).rig.cameras;
  }
  const auto listed = [](const std::vector<std::string>& list, const std::string& name) {
    return std::find(list.begin(), list.end(), name) != list.end() ||
           std::find(list.begin(), list.end(), "all") != list.end();
  };
  for (const auto* list : {&options.kept_intrinsics, &options.kept_poses}) {
    for (const std::string& name : *list) {
      if (name == "all" || listed(names, name)) continue;
      throw InvalidInput(
          fmt::format("there is no camera '{}'; the cameras are named after their "
                      "files: {}",
                      name, fmt::join(names, ", ")));
    }
  }
  std::vector<RigCamera> cameras;
  for (const std::string& name : names) {
    RigCamera camera;
    camera.name = name;
    const auto found =
        std::find_if(given.begin(), given.end(), [&](const Camera& c) { return c.name == name; });
    if (found != given.end()) camera.camera = *found;
    camera.keep_intrinsics = listed(options.kept_intrinsics, name);
    camera.keep_pose = listed(options.kept_poses, name);
    if ((camera.keep_intrinsics || camera.keep_pose) && !camera.camera) {
      throw InvalidInput(
          fmt::format("camera '{}' is to be kept, but {} has no camera of this name", name,
                      options.intrinsics.empty() ? "no --intrinsics file was given, which"
                                                 : options.intrinsics));
    }
    cameras.push_back(std::move(camera));
  }
  return cameras;
}

// Speed of each point in the picture from the frames before and after, where those show it.
Eigen::Matrix2Xd velocities(const SheetPictures& pictures, std::size_t index, double rate) {
  const Detection& now = pictures.detections[index];
  Eigen::Matrix2Xd result = Eigen::Matrix2Xd::Zero(2, now.points_px.cols());
  if (index == 0 || index + 1 >= pictures.detections.size()) return result;
  const Detection& before = pictures.detections[index - 1];
  const Detection& after = pictures.detections[index + 1];
  const auto column_of = [](const Detection& detection, int id) {
    const auto found = std::lower_bound(detection.ids.begin(), detection.ids.end(), id);
    return found != detection.ids.end() && *found == id ? found - detection.ids.begin() : -1;
  };
  for (std::size_t k = 0; k < now.ids.size(); ++k) {
    const auto a = column_of(before, now.ids[k]), b = column_of(after, now.ids[k]);
    if (a < 0 || b < 0) continue;
    result.col(static_cast<Eigen::Index>(k)) =
        0.5 * rate * (after.points_px.col(b) - before.points_px.col(a));
  }
  return result;
}

std::vector<RigView> rig_views(const std::vector<SheetPictures>& pictures, bool with_velocities) {
  std::vector<RigView> views;
  for (std::size_t c = 0; c < pictures.size(); ++c) {
    for (std::size_t i = 0; i < pictures[c].names.size(); ++i) {
      if (!pictures[c].detections[i].found()) continue;
      const PictureName& name = pictures[c].names[i];
      RigView view;
      view.camera = static_cast<int>(c);
      view.instant = name.frame < 0 ? static_cast<int>(i) : name.frame;
      view.name = name.text();
      view.detection = pictures[c].detections[i];
      if (with_velocities) {
        view.velocities_px_s = velocities(pictures[c], i, pictures[c].frames_per_second[0]);
      }
      views.push_back(std::move(view));
    }
  }
  return views;
}

void check_rates(const std::vector<SheetPictures>& pictures,
                 const std::vector<std::string>& names) {
  for (std::size_t c = 0; c < pictures.size(); ++c) {
    const std::vector<double>& rate = pictures[c].frames_per_second;
    if (rate.empty() || !(rate[0] > 0.0)) {
      throw InvalidInput(
          fmt::format("time offsets need videos with a rate; '{}' has none", names[c]));
    }
    if (std::abs(rate[0] / pictures[0].frames_per_second[0] - 1.0) > 0.001) {
      throw InvalidInput(
          fmt::format("'{}' has {:g} frames/s, but '{}' has {:g}: frame numbers do "
                      "not match",
                      names[c], rate[0], names[0], pictures[0].frames_per_second[0]));
    }
  }
}

void run_rig(const Context& context, const RigCommandOptions& options) {
  const auto progress = console_progress();
  const Target asked = parse_target(options.target);
  const std::vector<std::string> names = camera_names(options.files);
  const std::vector<RigCamera> known = known_cameras(names, options);
  std::vector<SheetPictures> pictures;
  double detect_s = 0.0;
  CalibrationReport report;
  for (const std::string& file : options.files) {
    const Target& target = pictures.empty() ? asked : pictures[0].target;
    pictures.push_back(
        find_sheet({file}, target, options.time_offsets ? 0 : options.most_frames, *progress));
    detect_s += pictures.back().detect_s;
    add_notes(pictures.back(), report.notes);
  }
  if (options.time_offsets) check_rates(pictures, names);

  RigOptions rig;
  rig.lens = *lens_from_name(options.lens);
  rig.aspect = !options.square_pixels;
  rig.principal = !options.centred;
  rig.warp = options.warp;
  rig.keep_outliers = options.keep_outliers;
  rig.time_offsets = options.time_offsets;
  rig.cancelled = [] { return interrupted(); };
  const std::vector<RigView> views = rig_views(pictures, options.time_offsets);
  const RigCalibration found = calibrate_rig(views, known, rig);

  report.title = fs::path(options.folder).filename().string();
  report.target = target_text(pictures[0].target);
  report.detect_s = detect_s;
  for (const int view : found.view_of_sighting) {
    report.sighting_names.push_back(views[static_cast<std::size_t>(view)].name);
  }
  note_size(asked, report.notes);
  prepare_output_folder(options.folder);
  write_rig((fs::path(options.folder) / "rig.json").string(), {found.cameras});
  const Verdict verdict = finish_calibration(options.folder, found.adjustment, report, *progress);

  Json summary{{"target", report.target},
               {"rms_px", found.adjustment.rms_px},
               {"rms_all_px", found.adjustment.rms_all_px},
               {"instants", found.instants.size()},
               {"cameras", Json::array()},
               {"solve_s", found.adjustment.solve_s},
               {"detect_s", detect_s}};
  for (std::size_t c = 0; c < found.cameras.size(); ++c) {
    summary["cameras"].push_back(json_of(found.adjustment, verdict, c));
    const double offset_s = found.adjustment.survey.time_offset_s[c];
    if (options.time_offsets) {
      summary["cameras"].back()["time_offset_s"] = offset_s;
      fmt::print("{}: clock {:+.2f} ms\n", found.cameras[c].name, 1e3 * offset_s);
    }
  }
  if (verdict.lengths) {
    summary["scale_error"] = verdict.lengths->scale_error;
    summary["length_rms_mm"] = verdict.lengths->rms_mm;
    fmt::print("points placed by rays alone: lengths {:+.3f} %, {:.2f} mm rms over {:.0f} mm\n",
               100.0 * verdict.lengths->scale_error, verdict.lengths->rms_mm,
               1e3 * verdict.lengths->mean_length_m);
  }
  add_warnings(verdict, report, summary);
  write_summary(context, summary.dump(1));
  fmt::print("results in {}: rig.json report.html and a map per camera\n", options.folder);
}

void add_sheet_options(CLI::App& command, SheetOptions& options) {
  command.add_option("--target", options.target, "The sheet, as for `calibrate detect`")
      ->required()
      ->check(sheet_name());
  command.add_option("--lens", options.lens, "Lens of the cameras")
      ->check(CLI::IsMember(lens_names()))
      ->capture_default_str();
  command.add_option("-o,--output", options.folder, "Folder for the results")->required();
  command
      .add_option("--most-frames", options.most_frames,
                  "Look at no more than so many frames of a video, in even steps (0: at all)")
      ->check(CLI::Range(0, 1000000))
      ->capture_default_str();
  command.add_flag("--square-pixels", options.square_pixels, "Both axes have one focal length");
  command.add_flag("--centred", options.centred,
                   "The principal point is the middle of the picture");
  command.add_flag("--warp", options.warp, "The sheet may be bent");
  command.add_flag("--keep-outliers", options.keep_outliers,
                   "Plain least squares: every point counts");
}

}  // namespace

std::vector<std::string> camera_names(const std::vector<std::string>& files) {
  std::vector<std::string> names;
  for (const std::string& file : files) {
    fs::path path(file);
    if (!path.has_filename()) path = path.parent_path();
    names.push_back(path.stem().string());
    if (std::count(names.begin(), names.end(), names.back()) > 1) {
      throw InvalidInput(
          fmt::format("two cameras are named '{}' after their files; give the files "
                      "different names",
                      names.back()));
    }
  }
  return names;
}

void add_calibrate_sheet_commands(CLI::App& calibrate, Context& context) {
  CLI::App* board = calibrate.add_subcommand("board", "One camera from pictures of a sheet");
  auto board_options = std::make_shared<SheetOptions>();
  board->add_option("pictures", board_options->files, "Pictures, videos, folders")->required();
  add_sheet_options(*board, *board_options);
  board->callback([&context, board_options] {
    context.action = [&context, board_options] { run_board(context, *board_options); };
  });

  CLI::App* rig = calibrate.add_subcommand(
      "rig", "Several cameras from a sheet that is carried about before them");
  auto rig_options = std::make_shared<RigCommandOptions>();
  rig->add_option("cameras", rig_options->files,
                  "A video or a folder of pictures for each camera; those of one number show one "
                  "instant")
      ->required()
      ->expected(2, 64);
  add_sheet_options(*rig, *rig_options);
  rig->add_option("--intrinsics", rig_options->intrinsics,
                  "Known cameras, by name, in any of the formats of `calibrate convert`");
  rig->add_option("--keep-intrinsics", rig_options->kept_intrinsics,
                  "Names of cameras whose lens stays as given, or all");
  rig->add_option("--keep-pose", rig_options->kept_poses,
                  "Names of cameras that stay where they are given, or all");
  rig->add_flag("--time-offsets", rig_options->time_offsets,
                "Clocks may be off by a constant: found from the sheet's motion");
  rig->callback([&context, rig_options] {
    context.action = [&context, rig_options] { run_rig(context, *rig_options); };
  });
}

}  // namespace semblance::cli
