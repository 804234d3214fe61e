// `semblance calibrate rig`: several cameras from a sheet that is carried about before them.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>

#include "calibration_results.h"
#include "semblance/cameras/rig_calibration.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/io/camera_rig.h"
#include "semblance/io/picture_size.h"
#include "sheet_command.h"

namespace semblance::cli {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct RigCommandOptions : SheetOptions {
  std::vector<std::string> names, intrinsics, kept_intrinsics, kept_poses;
  bool time_offsets = false;
  double most_offset_s = 1.0;
};

std::string named(const std::vector<Camera>& cameras) {
  std::vector<std::string> names;
  for (const Camera& camera : cameras) names.push_back(camera.name);
  return names.empty() ? "" : fmt::format("; it has {}", fmt::join(names, ", "));
}

std::vector<RigCamera> known_cameras(const std::vector<std::string>& names,
                                     const RigCommandOptions& options,
                                     std::vector<std::string>& notes) {
  const std::vector<Camera> given = given_cameras(options.intrinsics);
  const auto listed = [](const std::vector<std::string>& list, const std::string& name) {
    return std::find(list.begin(), list.end(), name) != list.end() ||
           std::find(list.begin(), list.end(), "all") != list.end();
  };
  for (const auto* list : {&options.kept_intrinsics, &options.kept_poses}) {
    for (const std::string& name : *list) {
      if (name == "all" || listed(names, name)) continue;
      throw InvalidInput(
          fmt::format("there is no camera '{}'; the cameras are {}", name, fmt::join(names, ", ")));
    }
  }
  std::vector<RigCamera> cameras;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::string &name = names[i], &file = options.files[i];
    RigCamera camera;
    camera.name = name;
    const auto found =
        std::find_if(given.begin(), given.end(), [&](const Camera& c) { return c.name == name; });
    if (found != given.end()) {
      camera.camera = camera_for_pictures(*found, first_picture(file), file, notes);
    } else if (!given.empty()) {
      notes.push_back(fmt::format("--intrinsics gives no camera '{}': its lens is sought{}", name,
                                  named(given)));
    }
    camera.keep_intrinsics = listed(options.kept_intrinsics, name);
    camera.keep_pose = listed(options.kept_poses, name);
    if ((camera.keep_intrinsics || camera.keep_pose) && !camera.camera) {
      throw InvalidInput(
          fmt::format("camera '{}' is to be kept, but --intrinsics gives no camera of this name{}",
                      name, named(given)));
    }
    cameras.push_back(std::move(camera));
  }
  return cameras;
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

// Pictures of a camera most of whose points are outliers: of another time, or of a moved camera.
void note_pictures_that_do_not_fit(const RigCalibration& found, std::vector<std::string>& notes) {
  struct Count {
    int points = 0, outliers = 0;
  };
  std::map<std::pair<int, int>, Count> counts;  // by camera and view
  for (std::size_t i = 0; i < found.view_of_sighting.size(); ++i) {
    const int camera = found.adjustment.survey.sightings[i].camera;
    Count& count = counts[{camera, found.view_of_sighting[i]}];
    ++count.points;
    count.outliers += found.adjustment.outlier[i];
  }
  for (std::size_t c = 0; c < found.cameras.size(); ++c) {
    int views = 0, bad = 0;
    for (const auto& [key, count] : counts) {
      if (key.first != static_cast<int>(c)) continue;
      ++views;
      bad += 2 * count.outliers > count.points;
    }
    if (bad == 0) continue;
    notes.push_back(fmt::format(
        "{}: {} of {} pictures do not fit the other cameras: they were taken at another "
        "time than those of their number, or the camera moved",
        found.cameras[c].name, bad, views));
  }
}

void note_cameras_that_disagree(const RigCalibration& found, const RigCommandOptions& options,
                                std::vector<std::string>& notes) {
  const std::string worse = disagreement(found);
  if (worse.empty()) return;
  notes.push_back(fmt::format(
      "{}: the cameras disagree about the sheet's place, and lenses found in the rig suffer. "
      "Pictures of one number may be of different times{}; calibrate lenses with `board` and keep "
      "them",
      worse, options.time_offsets ? "" : " (--time-offsets finds what is constant)"));
}

void add_time_offset(const RigCalibration& found, std::size_t camera, Json& summary) {
  const double offset_s = found.time_offset_s[camera];
  summary["time_offset_s"] = offset_s;
  fmt::print("{}: clock {:+.2f} ms", found.cameras[camera].name, 1e3 * offset_s);
  if (found.adjustment.covariance && camera > 0) {
    const double sigma_s = found.adjustment.covariance->cameras[camera].time_offset_s;
    summary["time_offset_sigma_s"] = sigma_s;
    fmt::print(", deviation {:.2f} ms", 1e3 * sigma_s);
  }
  fmt::print("\n");
}

RigOptions rig_options(const RigCommandOptions& options,
                       const std::vector<SheetPictures>& pictures) {
  auto rig = solver_options<RigOptions>(options);
  rig.time_offsets = options.time_offsets;
  if (options.time_offsets) {
    const double rate = pictures[0].frames_per_second[0];
    rig.step_s = 1.0 / rate;
    rig.most_lag = static_cast<int>(std::ceil(options.most_offset_s * rate));
  }
  return rig;
}

void run_rig(const Context& context, const RigCommandOptions& options) {
  const auto progress = console_progress();
  const Target asked = parse_target(options.target);
  const std::vector<std::string> names = camera_names(options.files, options.names);
  CalibrationReport report;
  const std::vector<RigCamera> known = known_cameras(names, options, report.notes);
  std::vector<SheetPictures> pictures;
  double detect_s = 0.0;
  for (const std::string& file : options.files) {
    const Target& target = pictures.empty() ? asked : pictures[0].target;
    pictures.push_back(
        find_sheet({file}, target, options.time_offsets ? 0 : options.most_frames, *progress));
    detect_s += pictures.back().detect_s;
    add_notes(pictures.back(), report.notes);
  }
  if (options.time_offsets) check_rates(pictures, names);

  const std::vector<RigView> views = rig_views(pictures, options.time_offsets);
  const RigCalibration found = calibrate_rig(views, known, rig_options(options, pictures));

  report.title = fs::path(options.folder).filename().string();
  report.target = target_text(pictures[0].target);
  report.detect_s = detect_s;
  for (const int view : found.view_of_sighting) {
    report.sighting_names.push_back(views[static_cast<std::size_t>(view)].name);
  }
  note_size(asked, report.notes);
  check_distances(options, pictures[0].target, found.cameras, report.notes);
  note_pictures_that_do_not_fit(found, report.notes);
  note_cameras_that_disagree(found, options, report.notes);
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
    if (const auto alone_px = found.fits[c].alone_px) {
      summary["cameras"].back()["alone_px"] = *alone_px;
    }
    if (options.time_offsets) add_time_offset(found, c, summary["cameras"].back());
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

}  // namespace

void add_calibrate_rig_command(CLI::App& calibrate, Context& context) {
  CLI::App* rig = calibrate.add_subcommand(
      "rig", "Several cameras from a sheet that is carried about before them");
  auto options = std::make_shared<RigCommandOptions>();
  rig->add_option("cameras", options->files,
                  "A video or a folder of pictures for each camera; those of one number show one "
                  "instant")
      ->required()
      ->expected(2, 64);
  add_sheet_options(*rig, *options);
  rig->add_option("--names", options->names, "Names of the cameras, instead of their files'")
      ->delimiter(',')
      ->allow_extra_args(false);
  rig->add_option("--intrinsics", options->intrinsics,
                  "Files of known cameras, by name, in any of the formats of `calibrate convert`");
  rig->add_option("--keep-intrinsics", options->kept_intrinsics,
                  "Names of cameras whose lens stays as given, or all");
  rig->add_option("--keep-pose", options->kept_poses,
                  "Names of cameras that stay where they are given, or all");
  rig->add_flag("--time-offsets", options->time_offsets,
                "Clocks may be off by a constant: found from the sheet's motion");
  rig->add_option("--most-offset", options->most_offset_s,
                  "Seconds that a clock may be off by, at most")
      ->check(CLI::Range(0.0, 3600.0))
      ->capture_default_str()
      ->needs("--time-offsets");
  rig->callback([&context, options] {
    context.action = [&context, options] { run_rig(context, *options); };
  });
}

}  // namespace semblance::cli
