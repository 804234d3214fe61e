#include "sheet_command.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <sstream>

#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"

namespace semblance::cli {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

std::vector<std::string> lens_names() {
  std::vector<std::string> names;
  for (const Lens lens : all_lenses) names.emplace_back(lens_name(lens));
  return names;
}

// A length measured by hand, between two cameras or two points of the sheet.
struct MeasuredDistance {
  std::string from, to;
  double length_m = 0.0;
};

std::optional<MeasuredDistance> parse_distance(const std::string& text) {
  std::istringstream stream(text);
  MeasuredDistance distance;
  std::string length;
  std::getline(stream, distance.from, ':');
  std::getline(stream, distance.to, ':');
  std::getline(stream, length);
  const CLI::Range positive(1e-6, 1e6);
  if (distance.from.empty() || distance.to.empty() || !positive(length).empty()) return {};
  distance.length_m = std::stod(length);
  return distance;
}

Eigen::Vector3d sheet_point(const Target& target, const std::string& id,
                            const std::vector<Camera>& cameras) {
  const std::vector<int> ids = point_ids(target);
  const auto found =
      std::find_if(ids.begin(), ids.end(), [&](int known) { return std::to_string(known) == id; });
  if (found != ids.end()) return point_on_sheet(target, *found);
  std::vector<std::string> names;
  for (const Camera& camera : cameras) names.push_back(camera.name);
  throw InvalidInput(fmt::format(
      "--distance: '{}' is no point of {} (they are numbered {} to {}){}", id, target_text(target),
      ids.front(), ids.back(),
      names.empty() ? "" : fmt::format(", and not one of the cameras {}", fmt::join(names, ", "))));
}

// The same distance by the calibration; cameras by their names, or points by their numbers.
double distance_m(const MeasuredDistance& measured, const Target& target,
                  const std::vector<Camera>& cameras) {
  std::vector<Eigen::Vector3d> ends;
  for (const std::string& name : {measured.from, measured.to}) {
    for (const Camera& camera : cameras) {
      if (camera.name == name) ends.push_back(camera.camera_from_world.inverse().translation_m);
    }
  }
  if (ends.size() == 2) return (ends[0] - ends[1]).norm();
  return (sheet_point(target, measured.from, cameras) - sheet_point(target, measured.to, cameras))
      .norm();
}

// Deviations of fx, fy, cx, cy; none where the lens was kept or the pictures leave it open.
std::optional<Eigen::Vector4d> lens_sigma_px(const Adjustment& adjustment, std::size_t camera) {
  if (!adjustment.covariance) return std::nullopt;
  const Eigen::MatrixXd& known = adjustment.covariance->cameras[camera].intrinsics;
  if (known.isZero(0.0)) return std::nullopt;
  return known.diagonal().head<4>().cwiseSqrt();
}

void print_camera(const CameraVerdict& verdict, const Camera& camera,
                  const std::optional<Eigen::Vector4d>& sigma_px) {
  fmt::print("{}: {:.3f} px rms over {} views, {} of {} points are outliers", camera.name,
             verdict.rms_px, verdict.placements, verdict.outliers, verdict.sightings);
  if (verdict.held_out > 0) fmt::print("; {:.3f} px where left out", verdict.held_out_px);
  fmt::print("\n  focal {:.2f} {:.2f} px, principal {:.2f} {:.2f} px", camera.focal_px.x(),
             camera.focal_px.y(), camera.principal_px.x(), camera.principal_px.y());
  if (sigma_px) {
    fmt::print(" (deviations {:.2f} {:.2f}, {:.2f} {:.2f})", (*sigma_px)[0], (*sigma_px)[1],
               (*sigma_px)[2], (*sigma_px)[3]);
  }
  fmt::print(", {:.0f} % of the picture covered\n", 100.0 * verdict.coverage);
}

}  // namespace

void add_notes(const SheetPictures& pictures, std::vector<std::string>& notes) {
  std::map<std::string, int> counts;
  for (const Detection& detection : pictures.detections) {
    for (const DetectionWarning& warning : detection.warnings) ++counts[warning.text];
  }
  for (const auto& [text, count] : counts) {
    notes.push_back(count > 1 ? fmt::format("{} ({} pictures)", text, count) : text);
  }
}

void note_size(const Target& asked, std::vector<std::string>& notes) {
  if (asked.kind == TargetKind::automatic && !(asked.size_m > 0.0)) {
    notes.emplace_back(
        "the sheet's size is not known: 1 m was assumed, and distances are in that unit; give it "
        "as in auto:0.025");
  }
}

void check_distances(const SheetOptions& options, const Target& target,
                     const std::vector<Camera>& cameras, std::vector<std::string>& notes) {
  constexpr double tolerance = 0.01;  // a millimetre in ten centimetres
  for (const std::string& text : options.distances) {
    const MeasuredDistance measured = *parse_distance(text);
    const double found_m = distance_m(measured, target, cameras);
    const double ratio = measured.length_m / found_m;
    if (std::abs(ratio - 1.0) <= tolerance) continue;
    const auto resized = [&](double length_m) {
      return std::stod(fmt::format("{:.4g}", ratio * length_m));
    };
    Target other = target;
    other.size_m = resized(target.size_m);
    other.marker_m = resized(target.marker_m);
    notes.push_back(fmt::format(
        "from {} to {} you measured {:.4g} m, but it is {:.4g} m if the sheet is {}: one of the "
        "two is wrong. If your measure is right, the sheet is {}, and all lengths are {:.4g} times "
        "as long",
        measured.from, measured.to, measured.length_m, found_m, target_text(target),
        target_text(other), ratio));
  }
}

Json json_of(const Verdict& verdicts, const Adjustment& adjustment, std::size_t index) {
  const CameraVerdict& verdict = verdicts.cameras[index];
  const Camera& camera = adjustment.survey.cameras[index];
  Json json{{"name", camera.name},
            {"rms_px", verdict.rms_px},
            {"focal_px", {camera.focal_px.x(), camera.focal_px.y()}},
            {"principal_px", {camera.principal_px.x(), camera.principal_px.y()}},
            {"views", verdict.placements},
            {"points", verdict.sightings},
            {"outliers", verdict.outliers},
            {"coverage", verdict.coverage}};
  if (const auto sigma = lens_sigma_px(adjustment, index)) {
    json["focal_sigma_px"] = {(*sigma)[0], (*sigma)[1]};
    json["principal_sigma_px"] = {(*sigma)[2], (*sigma)[3]};
  }
  if (verdict.held_out > 0) json["held_out_px"] = verdict.held_out_px;
  if (verdict.sigma_px.size() > 0) {
    json["worst_sigma_px"] =
        verdict.sigma_px.array().isFinite().select(verdict.sigma_px, 0.0).maxCoeff();
  }
  return json;
}

Verdict finish_calibration(const SheetOptions& options, const Adjustment& adjustment,
                           const CalibrationReport& report, Progress& progress) {
  const Verdict verdict = judge(adjustment, progress);
  const fs::path folder(options.folder);
  for (std::size_t i = 0; i < verdict.cameras.size(); ++i) {
    const Camera& camera = adjustment.survey.cameras[i];
    if (verdict.cameras[i].sigma_px.size() > 0) {
      AtomicFile map(folder / ("uncertainty_" + camera.name + ".svg"));
      map.stream() << uncertainty_svg(adjustment, verdict, static_cast<int>(i));
      map.commit();
    }
    print_camera(verdict.cameras[i], camera, lens_sigma_px(adjustment, i));
  }
  write_calibration_report((folder / "report.html").string(), adjustment, verdict, report);
  for (const auto* list : {&verdict.warnings, &report.notes}) {
    for (const std::string& text : *list) fmt::print("warning: {}\n", text);
  }
  return verdict;
}

void add_warnings(const Verdict& verdict, const CalibrationReport& report, Json& summary) {
  summary["warnings"] = verdict.warnings;
  for (const std::string& note : report.notes) summary["warnings"].push_back(note);
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
  command
      .add_option("--distance", options.distances,
                  "A length measured by hand, to check the sheet's size: A:B:METRES between two "
                  "points of the sheet (their numbers) or two cameras of a rig (their names)")
      ->check(CLI::Validator(
          [](const std::string& text) {
            return parse_distance(text) ? "" : "expected A:B:METRES, as in left:right:0.3";
          },
          "A:B:METRES"))
      ->allow_extra_args(false);
  command.add_flag("--square-pixels", options.square_pixels, "Both axes have one focal length");
  command.add_flag("--centred", options.centred,
                   "The principal point is the middle of the picture");
  command.add_flag("--warp", options.warp, "The sheet may be bent");
  command.add_flag("--keep-outliers", options.keep_outliers,
                   "Plain least squares: every point counts");
}

void add_calibrate_sheet_commands(CLI::App& calibrate, Context& context) {
  add_calibrate_board_command(calibrate, context);
  add_calibrate_rig_command(calibrate, context);
}

}  // namespace semblance::cli
