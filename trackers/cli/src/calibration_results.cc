#include "calibration_results.h"

#include <fmt/format.h>

#include <filesystem>
#include <optional>

#include "semblance/core/atomic_file.h"

namespace semblance::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// Deviations of fx, fy, cx, cy; none where the lens was kept or the pictures leave it open.
std::optional<Eigen::Vector4d> lens_sigma_px(const Adjustment& adjustment, std::size_t camera) {
  if (!adjustment.covariance) return std::nullopt;
  const Eigen::MatrixXd& known = adjustment.covariance->cameras[camera].intrinsics;
  if (known.isZero(0.0)) return std::nullopt;
  return known.diagonal().head<4>().cwiseSqrt();
}

void print_camera(const Adjustment& adjustment, const Verdict& verdict, std::size_t index) {
  const CameraVerdict& judged = verdict.cameras[index];
  const Camera& camera = adjustment.survey.cameras[index];
  fmt::print("{}: {:.3f} px rms over {} views, {} of {} points are outliers", camera.name,
             judged.rms_px, judged.placements, judged.outliers, judged.sightings);
  if (judged.held_out > 0) fmt::print("; {:.3f} px where left out", judged.held_out_px);
  fmt::print("\n  focal {:.2f} {:.2f} px, principal {:.2f} {:.2f} px", camera.focal_px.x(),
             camera.focal_px.y(), camera.principal_px.x(), camera.principal_px.y());
  if (const auto sigma_px = lens_sigma_px(adjustment, index)) {
    fmt::print(" (deviations {:.2f} {:.2f}, {:.2f} {:.2f})", (*sigma_px)[0], (*sigma_px)[1],
               (*sigma_px)[2], (*sigma_px)[3]);
  }
  fmt::print(", {:.0f} % of the picture covered\n", 100.0 * judged.coverage);
}

}  // namespace

Json json_of(const Adjustment& adjustment, const Verdict& verdict, std::size_t index) {
  const CameraVerdict& judged = verdict.cameras[index];
  const Camera& camera = adjustment.survey.cameras[index];
  Json json{{"name", camera.name},
            {"rms_px", judged.rms_px},
            {"focal_px", {camera.focal_px.x(), camera.focal_px.y()}},
            {"principal_px", {camera.principal_px.x(), camera.principal_px.y()}},
            {"views", judged.placements},
            {"points", judged.sightings},
            {"outliers", judged.outliers},
            {"coverage", judged.coverage}};
  if (const auto sigma = lens_sigma_px(adjustment, index)) {
    json["focal_sigma_px"] = {(*sigma)[0], (*sigma)[1]};
    json["principal_sigma_px"] = {(*sigma)[2], (*sigma)[3]};
  }
  if (judged.held_out > 0) json["held_out_px"] = judged.held_out_px;
  if (judged.sigma_px.size() > 0) {
    json["worst_sigma_px"] =
        judged.sigma_px.array().isFinite().select(judged.sigma_px, 0.0).maxCoeff();
  }
  return json;
}

Verdict finish_calibration(const std::string& results, const Adjustment& adjustment,
                           const CalibrationReport& report, Progress& progress) {
  const Verdict verdict = judge(adjustment, progress);
  const fs::path folder(results);
  for (std::size_t i = 0; i < verdict.cameras.size(); ++i) {
    const Camera& camera = adjustment.survey.cameras[i];
    if (verdict.cameras[i].sigma_px.size() > 0) {
      AtomicFile map(folder / ("uncertainty_" + camera.name + ".svg"));
      map.stream() << uncertainty_svg(adjustment, verdict, static_cast<int>(i));
      map.commit();
    }
    print_camera(adjustment, verdict, i);
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

std::vector<std::string> lens_names() {
  std::vector<std::string> names;
  for (const Lens lens : all_lenses) names.emplace_back(lens_name(lens));
  return names;
}

}  // namespace semblance::cli
