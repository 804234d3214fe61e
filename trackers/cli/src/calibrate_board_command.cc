// `semblance calibrate board`: one camera from pictures of a sheet.
#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "calibration_results.h"
#include "semblance/cameras/board_calibration.h"
#include "semblance/core/atomic_file.h"
#include "semblance/io/camera_io.h"
#include "sheet_command.h"

namespace semblance::cli {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct BoardCommandOptions : SheetOptions {
  std::string name = "camera";
};

std::vector<std::string> texts(const std::vector<PictureName>& names) {
  std::vector<std::string> result;
  for (const PictureName& name : names) result.push_back(name.text());
  return result;
}

void run_board(const Context& context, const BoardCommandOptions& options) {
  const auto progress = console_progress();
  const Target asked = parse_target(options.target);
  const SheetPictures pictures = find_sheet(options.files, asked, options.most_frames, *progress);
  const std::vector<std::string> names = texts(pictures.names);
  BoardCalibration found =
      calibrate_board(pictures.detections, names, solver_options<BoardOptions>(options));
  found.camera.name = found.adjustment.survey.cameras[0].name = options.name;

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
  check_distances(options, pictures.target, {}, report.notes);
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
  fmt::print("results in {}: camera.json report.html uncertainty_{}.svg\n", options.folder,
             options.name);
}

}  // namespace

void add_calibrate_board_command(CLI::App& calibrate, Context& context) {
  CLI::App* board = calibrate.add_subcommand("board", "One camera from pictures of a sheet");
  auto options = std::make_shared<BoardCommandOptions>();
  board->add_option("pictures", options->files, "Pictures, videos, folders")->required();
  add_sheet_options(*board, *options);
  board->add_option("--name", options->name, "The camera's name, for `rig --intrinsics`")
      ->capture_default_str();
  board->callback([&context, options] {
    context.action = [&context, options] { run_board(context, *options); };
  });
}

}  // namespace semblance::cli
