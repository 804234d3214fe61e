// What `calibrate board` and `calibrate rig` have in common.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "commands.h"
#include "semblance/cameras/calibration_report.h"
#include "semblance/cameras/sheet_pictures.h"
#include "semblance/core/progress.h"

namespace semblance::cli {

struct SheetOptions {
  std::vector<std::string> files;
  std::vector<std::string> distances;  // as in "left:right:0.3"
  std::string target, lens = "brown5", folder;
  int most_frames = 200;
  bool square_pixels = false, centred = false, warp = false, keep_outliers = false;
};

void add_sheet_options(CLI::App& command, SheetOptions& options);

/// What the detection warned of, each text once.
void add_notes(const SheetPictures& pictures, std::vector<std::string>& notes);

/// A sheet whose size no one told: the shape of the result is right, its scale is not.
void note_size(const Target& asked, std::vector<std::string>& notes);

/// The sheet's size gives the scale; lengths measured by hand tell whether it is right. Throws
/// InvalidInput for ends that are neither points of the sheet nor among the cameras.
void check_distances(const SheetOptions& options, const Target& target,
                     const std::vector<Camera>& cameras, std::vector<std::string>& notes);

/// What is known of one camera, for the summary.
nlohmann::ordered_json json_of(const Verdict& verdicts, const Adjustment& adjustment,
                               std::size_t index);

/// Judges; writes report and maps; prints cameras and warnings.
Verdict finish_calibration(const SheetOptions& options, const Adjustment& adjustment,
                           const CalibrationReport& report, Progress& progress);

void add_warnings(const Verdict& verdict, const CalibrationReport& report,
                  nlohmann::ordered_json& summary);

void add_calibrate_board_command(CLI::App& calibrate, Context& context);
void add_calibrate_rig_command(CLI::App& calibrate, Context& context);

}  // namespace semblance::cli
