// What the commands of `calibrate` that solve for cameras have in common once they are solved.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "semblance/cameras/calibration_report.h"
#include "semblance/core/progress.h"

namespace semblance::cli {

/// What the verdict says of one camera, for the summary.
nlohmann::ordered_json json_of(const Adjustment& adjustment, const Verdict& verdict,
                               std::size_t camera);

/// Judges; writes report.html and a map of the projection's uncertainty per camera to the folder;
/// prints the figures and warnings.
Verdict finish_calibration(const std::string& folder, const Adjustment& adjustment,
                           const CalibrationReport& report, Progress& progress);

/// Warnings of the verdict and notes of the report, for the summary.
void add_warnings(const Verdict& verdict, const CalibrationReport& report,
                  nlohmann::ordered_json& summary);

/// Names of all lenses, for options.
std::vector<std::string> lens_names();

}  // namespace semblance::cli
