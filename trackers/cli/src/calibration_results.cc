#include "calibration_results.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <filesystem>

#include "semblance/core/atomic_file.h"

namespace semblance::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// Deviations of fx, fy, cx, cy; zero where they were kept or nothing is known of them.
std::array<double, 4> intrinsic_sigmas_px(const Adjustment& adjustment, std::size_t camera) {
  std::array<double, 4> sigmas{};
  if (!adjustment.covariance) return sigmas;
  const Eigen::MatrixXd& covariance = adjustment.covariance->cameras[camera].intrinsics;
  for (int i = 0; i < 4; ++i) sigmas[static_cast<std::size_t>(i)] = std::sqrt(covariance(i, i));
  return sigmas;
}

std::string with_sigma(double value, double sigma) {
  return sigma > 0.0 ? fmt::format("{:.2f} ± {:.2f}", value, sigma) : fmt::format("{:.2f}", value);
}

void print_camera(const Adjustment& adjustment, const Verdict& verdict, std::size_t index) {
  const CameraVerdict& judged = verdict.cameras[index];
  const Camera& camera = adjustment.survey.cameras[index];
  const std::array<double, 4> sigmas = intrinsic_sigmas_px(adjustment, index);
  fmt::print("{}: {:.3f} px rms over {} views, {} of {} points are outliers", camera.name,
             judged.rms_px, judged.placements, judged.outliers, judged.sightings);
  if (judged.held_out > 0) fmt::print("; {:.3f} px where left out", judged.held_out_px);
  fmt::print("\n  focal {}, {} px, principal {}, {} px, {:.0f} % of the picture covered\n",
             with_sigma(camera.focal_px.x(), sigmas[0]), with_sigma(camera.focal_px.y(), sigmas[1]),
             with_sigma(camera.principal_px.x(), sigmas[2]),
             with_sigma(camera.principal_px.y(), sigmas[3]), 100.0 * judged.coverage);
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
  if (adjustment.covariance) {
    const std::array<double, 4> sigmas = intrinsic_sigmas_px(adjustment, index);
    json["focal_sigma_px"] = {sigmas[0], sigmas[1]};
    json["principal_sigma_px"] = {sigmas[2], sigmas[3]};
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
