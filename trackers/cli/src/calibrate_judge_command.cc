// `semblance calibrate judge`: are stored cameras still right?
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <numbers>

#include "calibration_results.h"
#include "commands.h"
#include "semblance/cameras/review.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/io/picture_size.h"
#include "sheet_command.h"

namespace semblance::cli {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct JudgeOptions : SheetOptions {
  std::vector<std::string> cameras, names;
};

// The stored cameras in the order of the pictures. One camera's pictures are all of that one.
std::vector<Camera> stored_cameras(const JudgeOptions& options, std::vector<std::string>& notes) {
  const std::vector<Camera> stored = given_cameras(options.cameras);
  if (stored.size() == 1) {
    return {
        camera_for_pictures(stored[0], first_picture(options.files[0]), options.files[0], notes)};
  }
  const std::vector<std::string> names = camera_names(options.files, options.names);
  std::vector<Camera> cameras;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto found = std::find_if(stored.begin(), stored.end(),
                                    [&](const Camera& camera) { return camera.name == names[i]; });
    if (found == stored.end()) {
      throw InvalidInput(fmt::format(
          "no stored camera is named '{}'; name the pictures' cameras with --names", names[i]));
    }
    cameras.push_back(
        camera_for_pictures(*found, first_picture(options.files[i]), options.files[i], notes));
  }
  return cameras;
}

std::vector<SheetPictures> look_for_sheet(const JudgeOptions& options, bool one_camera,
                                          Progress& progress) {
  Target target = parse_target(options.target);
  if (one_camera) return {find_sheet(options.files, target, options.most_frames, progress)};
  std::vector<SheetPictures> pictures;
  for (const std::string& file : options.files) {
    pictures.push_back(find_sheet({file}, target, options.most_frames, progress));
    target = pictures[0].target;
  }
  return pictures;
}

Json json_of(const Camera& camera, const CameraReview& review) {
  Json json{
      {"name", camera.name}, {"rms_px", review.rms_px}, {"refit_rms_px", review.refit_rms_px}};
  if (!review.has_sigma) return json;
  json["lens_change_px"] = review.mean_change_px;
  json["lens_change_sigma_px"] = review.mean_sigma_px;
  json["worst_lens_change_px"] = review.worst_change_px;
  if (review.turn_sigma_rad == 0.0) return json;
  json["turn_rad"] = review.turn_rad;
  json["turn_sigma_rad"] = review.turn_sigma_rad;
  json["shift_m"] = review.shift_m;
  json["shift_sigma_m"] = review.shift_sigma_m;
  return json;
}

void print(const Camera& camera, const CameraReview& review) {
  fmt::print("{}: {:.3f} px rms as stored, {:.3f} px fitted anew", camera.name, review.rms_px,
             review.refit_rms_px);
  if (review.has_sigma) {
    fmt::print("; lens off by {:.2f} px (deviation {:.2f})", review.mean_change_px,
               review.mean_sigma_px);
    if (review.turn_sigma_rad > 0.0) {
      fmt::print(", turned by {:.3f} degrees ({:.3f}), shifted by {:.1f} mm ({:.1f})",
                 review.turn_rad * 180.0 / std::numbers::pi,
                 review.turn_sigma_rad * 180.0 / std::numbers::pi, 1e3 * review.shift_m,
                 1e3 * review.shift_sigma_m);
    }
  }
  fmt::print("\n");
}

void run_judge(const Context& context, const JudgeOptions& options) {
  const auto progress = console_progress();
  CalibrationReport report;
  const std::vector<Camera> cameras = stored_cameras(options, report.notes);
  const std::vector<SheetPictures> pictures =
      look_for_sheet(options, cameras.size() == 1, *progress);
  for (const SheetPictures& seen : pictures) {
    add_notes(seen, report.notes);
    report.detect_s += seen.detect_s;
  }
  const std::vector<RigView> views = rig_views(pictures, false);
  const CalibrationReview review = review_calibration(views, cameras, [] { return interrupted(); });
  report.title = fs::path(options.folder).filename().string();
  report.target = target_text(pictures[0].target);
  for (const int view : review.given.view_of_sighting) {
    report.sighting_names.push_back(views[static_cast<std::size_t>(view)].name);
  }
  note_size(parse_target(options.target), report.notes);
  check_distances(options, pictures[0].target, cameras, report.notes);
  report.notes.insert(report.notes.end(), review.warnings.begin(), review.warnings.end());
  for (std::size_t i = 0; i < cameras.size(); ++i) print(cameras[i], review.cameras[i]);

  prepare_output_folder(options.folder);
  const Verdict verdict =
      finish_calibration(options.folder, review.given.adjustment, report, *progress);
  Json summary{{"target", report.target}, {"cameras", Json::array()}};
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    summary["cameras"].push_back(json_of(cameras[i], review.cameras[i]));
    if (const auto alone_px = review.refit.fits[i].alone_px) {
      summary["cameras"].back()["alone_px"] = *alone_px;
    }
  }
  if (verdict.lengths) {
    summary["scale_error"] = verdict.lengths->scale_error;
    summary["length_rms_mm"] = verdict.lengths->rms_mm;
  }
  summary["changed"] = !review.warnings.empty();
  add_warnings(verdict, report, summary);
  write_summary(context, summary.dump(1));
  fmt::print("{}; results in {}: report.html\n",
             review.warnings.empty() ? "nothing has changed that these pictures show"
                                     : "not as stored: see the warnings",
             options.folder);
}

}  // namespace

void add_calibrate_judge_command(CLI::App& calibrate, Context& context) {
  CLI::App* judge = calibrate.add_subcommand(
      "judge", "Are stored cameras still right? By new pictures of a sheet");
  auto options = std::make_shared<JudgeOptions>();
  judge
      ->add_option("pictures", options->files,
                   "Pictures or videos of one camera; for a rig one video or folder per camera")
      ->required();
  judge
      ->add_option("--cameras", options->cameras,
                   "Files of the stored cameras, in any of the formats of `calibrate convert`")
      ->required()
      ->allow_extra_args(false);
  judge->add_option("--names", options->names, "Names of a rig's cameras, instead of their files'")
      ->delimiter(',')
      ->allow_extra_args(false);
  add_sheet_options(*judge, *options);
  judge->callback([&context, options] {
    context.action = [&context, options] { run_judge(context, *options); };
  });
}

}  // namespace semblance::cli
