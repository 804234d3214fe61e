#include "semblance/cameras/calibration_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <numbers>

#include "semblance/core/atomic_file.h"
#include "semblance/core/html_page.h"
#include "semblance/core/version.h"

namespace semblance {
namespace {

constexpr double kDegrees = 180.0 / std::numbers::pi;
constexpr double kMapWidth = 640.0, kResidualScale = 40.0, kLongestResidual = 40.0;
constexpr std::array kSteps_px{0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0};
// Light to dark blue, then to red: also ordered in black and white.
constexpr std::array<const char*, 8> kColours{"#f1f5f9", "#d6e4f0", "#b3cfe5", "#86b4d6",
                                              "#f3c98b", "#e59a5a", "#cf5f3d", "#9c2b2b"};

const char* colour_of(double sigma_px) {
  const auto step = std::upper_bound(kSteps_px.begin(), kSteps_px.end(), sigma_px);
  return kColours[static_cast<std::size_t>(step - kSteps_px.begin())];
}

// One picture: how its sightings fit.
struct PictureFit {
  int camera = 0, points = 0, outliers = 0;
  double square = 0.0;

  double rms_px() const { return std::sqrt(square / std::max(points, 1)); }
};

class Page {
 public:
  Page(const Adjustment& adjustment, const Verdict& verdict, const CalibrationReport& report)
      : adjustment_(adjustment), verdict_(verdict), report_(report) {}

  std::string write() {
    out_ = html_head(report_.title + " – calibration report");
    out_ += fmt::format("<body><main>\n<h1>{}</h1>\n<p class=\"sub\">Calibration report{}</p>\n",
                        escape_html(report_.title),
                        report_.target.empty() ? "" : ", " + escape_html(report_.target));
    cards();
    warnings();
    for (std::size_t i = 0; i < verdict_.cameras.size(); ++i) camera(i);
    drawn_pictures();
    pictures();
    how_to_read();
    out_ +=
        fmt::format("<footer>Written by {}.</footer>\n</main></body></html>\n", program_version());
    return out_;
  }

 private:
  void cards() {
    double held_out = 0.0, sigma = 0.0;
    for (const CameraVerdict& camera : verdict_.cameras) {
      held_out = std::max(held_out, camera.held_out_px);
      sigma = std::max(sigma, worst_sigma(camera));
    }
    const auto outliers = std::count(adjustment_.outlier.begin(), adjustment_.outlier.end(), 1);
    out_ += "<div class=\"cards\">\n";
    out_ += html_card(fmt::format("{:.3f} px", adjustment_.rms_px), "residual (rms)");
    if (held_out > 0.0) {
      out_ += html_card(fmt::format("{:.3f} px", held_out), "residual of views left out",
                        held_out > 1.5 * adjustment_.rms_px ? "bad" : "good");
    }
    if (sigma > 0.0) {
      out_ += html_card(fmt::format("{:.2f} px", sigma), "projection's worst deviation",
                        sigma > 1.0 ? "bad" : "good");
    }
    out_ += html_card(std::to_string(adjustment_.survey.sightings.size()),
                      fmt::format("points in {} placements", placements()));
    out_ += html_card(std::to_string(outliers), "outliers", outliers > 0 ? "warn" : "good");
    if (verdict_.lengths) {
      out_ +=
          html_card(fmt::format("{:+.3f} %", 100.0 * verdict_.lengths->scale_error),
                    fmt::format("lengths by rays alone, {:.2f} mm rms over {:.0f} mm",
                                verdict_.lengths->rms_mm, 1e3 * verdict_.lengths->mean_length_m));
    }
    out_ += "</div>\n";
  }

  void warnings() {
    if (verdict_.warnings.empty() && report_.notes.empty()) return;
    out_ += "<h2>Warnings</h2>\n<ul>\n";
    for (const auto* list : {&verdict_.warnings, &report_.notes}) {
      for (const std::string& text : *list) out_ += "<li>" + escape_html(text) + "</li>\n";
    }
    out_ += "</ul>\n";
  }

  void camera(std::size_t i) {
    const Camera& camera = adjustment_.survey.cameras[i];
    const CameraVerdict& verdict = verdict_.cameras[i];
    out_ += fmt::format(
        "<h2>{}</h2>\n<p class=\"sub\">{} × {} pixels, lens {}; {} points in {} "
        "placements, {} outliers, residual {:.3f} px{}; {:.0f} % of the picture "
        "covered</p>\n",
        escape_html(camera.name), camera.width, camera.height, lens_name(camera.lens),
        verdict.sightings, verdict.placements, verdict.outliers, verdict.rms_px,
        verdict.held_out > 0 ? fmt::format(", {:.3f} px where left out", verdict.held_out_px) : "",
        100.0 * verdict.coverage);
    out_ += "<div class=\"pair\"><div>" +
            uncertainty_svg(adjustment_, verdict_, static_cast<int>(i)) + legend() + "</div><div>";
    parameters(i);
    if (verdict.next) {
      out_ += fmt::format(
          "<p class=\"note\">A picture of the sheet where the dashed outline is "
          "(about {:.2f} m away) would help most: the projection's deviation "
          "falls from {:.3f} to {:.3f} px.</p>\n",
          verdict.next->camera_from_sheet.translation_m.norm(), verdict.next->mean_sigma_before_px,
          verdict.next->mean_sigma_after_px);
    }
    out_ += "</div></div>\n";
  }

  void row(const std::string& name, double value, double sigma, const char* unit) {
    out_ += fmt::format(
        "<tr><td>{}</td><td class=\"n\">{:.6g}</td><td class=\"n\">{}</td>"
        "<td>{}</td></tr>\n",
        name, value, sigma > 0.0 ? fmt::format("{:.2g}", sigma) : "kept", unit);
  }

  void parameters(std::size_t i) {
    const Camera& camera = adjustment_.survey.cameras[i];
    const CameraUncertainty* known =
        adjustment_.covariance ? &adjustment_.covariance->cameras[i] : nullptr;
    const auto sigma = [&](int k) { return known ? std::sqrt(known->intrinsics(k, k)) : 0.0; };
    out_ +=
        "<table><tr><th>parameter</th><th class=\"n\">value</th><th class=\"n\">σ</th>"
        "<th></th></tr>\n";
    row("f<sub>x</sub>", camera.focal_px.x(), sigma(0), "px");
    row("f<sub>y</sub>", camera.focal_px.y(), sigma(1), "px");
    row("c<sub>x</sub>", camera.principal_px.x(), sigma(2), "px");
    row("c<sub>y</sub>", camera.principal_px.y(), sigma(3), "px");
    for (int k = 0; k < coefficient_count(camera.lens); ++k) {
      row(std::string(coefficient_name(camera.lens, k)),
          camera.distortion[static_cast<std::size_t>(k)], sigma(4 + k), "");
    }
    if (adjustment_.survey.cameras.size() > 1) {
      const Eigen::Vector3d centre = camera.camera_from_world.inverse().translation_m;
      const Eigen::Matrix3d spread =
          known ? centre_covariance(camera, *known) : Eigen::Matrix3d::Zero().eval();
      const double turn = known ? std::sqrt(known->pose.topLeftCorner<3, 3>().trace()) : 0.0;
      const char* axes[] = {"x", "y", "z"};
      for (int k = 0; k < 3; ++k) {
        row(fmt::format("centre {}", axes[k]), centre[k], std::sqrt(spread(k, k)), "m");
      }
      row("direction", 0.0, kDegrees * turn, "degrees (only σ)");
    }
    out_ += "</table>\n";
  }

  static std::string legend() {
    std::string text = "<div class=\"legend\"><span>σ of the projection, px:</span>";
    for (std::size_t i = 0; i < kColours.size(); ++i) {
      const std::string label =
          i < kSteps_px.size() ? fmt::format("below {}", kSteps_px[i]) : std::string("more");
      text += fmt::format("<span><i style=\"background:{}\"></i>{}</span>", kColours[i], label);
    }
    return text + "</div>\n";
  }

  void drawn_pictures() {
    if (report_.pictures.empty()) return;
    out_ += "<h2>What was found</h2>\n<div class=\"pair\">\n";
    for (const ReportPicture& picture : report_.pictures) {
      out_ += fmt::format("<div>{}<p class=\"note\">{}</p></div>\n", picture.svg,
                          escape_html(picture.caption));
    }
    out_ += "</div>\n";
  }

  void pictures() {
    std::map<std::string, PictureFit> fits;
    const Survey& survey = adjustment_.survey;
    for (std::size_t i = 0; i < survey.sightings.size(); ++i) {
      PictureFit& fit = fits[report_.sighting_names[i]];
      fit.camera = survey.sightings[i].camera;
      ++fit.points;
      fit.outliers += adjustment_.outlier[i];
      const double square = residual_px(survey, survey.sightings[i]).squaredNorm();
      fit.square += std::isfinite(square) ? square : 0.0;
    }
    std::vector<std::pair<std::string, PictureFit>> worst(fits.begin(), fits.end());
    std::stable_sort(worst.begin(), worst.end(), [](const auto& a, const auto& b) {
      return a.second.rms_px() > b.second.rms_px();
    });
    constexpr std::size_t most = 40;
    out_ += fmt::format(
        "<h2>Pictures</h2>\n<p class=\"note\">{} pictures, the worst first{}.</p>\n"
        "<table><tr><th>picture</th><th>camera</th><th class=\"n\">points</th>"
        "<th class=\"n\">outliers</th><th class=\"n\">residual, px</th></tr>\n",
        worst.size(), worst.size() > most ? fmt::format("; {} shown", most) : "");
    if (worst.size() > most) worst.resize(most);
    for (const auto& [name, fit] : worst) {
      out_ += fmt::format(
          "<tr><td>{}</td><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td>"
          "<td class=\"n\">{:.3f}</td></tr>\n",
          escape_html(std::filesystem::path(name).filename().string()),
          escape_html(survey.cameras[static_cast<std::size_t>(fit.camera)].name), fit.points,
          fit.outliers, fit.rms_px());
    }
    out_ += "</table>\n";
  }

  void how_to_read() {
    out_ +=
        "<h2>How to read this page</h2>\n<p class=\"note\">A small residual says that the model "
        "follows its pictures, not that it is right elsewhere. The residual of views left out "
        "is measured by cameras that never saw them. The map shows how far the pixel of a "
        "direction may be off, at one deviation; where the sheet was never shown it grows. "
        "Deviations follow from the residuals and the geometry of the views; they know nothing "
        "of a bent sheet, a wrong size or a lens of another kind.</p>\n";
    out_ += fmt::format(
        "<p class=\"note\">Detection {:.2f} s, adjustment {:.3f} s in {} "
        "iterations.</p>\n",
        report_.detect_s, adjustment_.solve_s, adjustment_.iterations);
  }

  static double worst_sigma(const CameraVerdict& camera) {
    if (camera.sigma_px.size() == 0) return 0.0;
    return camera.sigma_px.array().isFinite().select(camera.sigma_px, 0.0).maxCoeff();
  }
  std::size_t placements() const { return adjustment_.survey.world_from_target.size(); }

  const Adjustment& adjustment_;
  const Verdict& verdict_;
  const CalibrationReport& report_;
  std::string out_;
};

}  // namespace

std::string uncertainty_svg(const Adjustment& adjustment, const Verdict& verdict, int camera) {
  const auto at = static_cast<std::size_t>(camera);
  const Camera& seen_by = adjustment.survey.cameras[at];
  const CameraVerdict& judged = verdict.cameras[at];
  const double scale = kMapWidth / seen_by.width, height = scale * seen_by.height;
  std::string out = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {:.0f} {:.0f}\" width=\"100%\">\n"
      "<rect width=\"100%\" height=\"100%\" fill=\"#fff\" stroke=\"#98a2ab\"/>\n",
      kMapWidth, height);
  for (Eigen::Index row = 0; row < judged.sigma_px.rows(); ++row) {
    for (Eigen::Index column = 0; column < judged.sigma_px.cols(); ++column) {
      const double sigma_px = judged.sigma_px(row, column);
      if (!std::isfinite(sigma_px)) continue;
      const double w = kMapWidth / static_cast<double>(judged.sigma_px.cols());
      const double h = height / static_cast<double>(judged.sigma_px.rows());
      out += fmt::format(
          "<rect x=\"{:.2f}\" y=\"{:.2f}\" width=\"{:.2f}\" height=\"{:.2f}\" "
          "fill=\"{}\"><title>{:.3f} px</title></rect>\n",
          static_cast<double>(column) * w, static_cast<double>(row) * h, w, h, colour_of(sigma_px),
          sigma_px);
    }
  }
  const std::vector<Sighting>& sightings = adjustment.survey.sightings;
  for (std::size_t i = 0; i < sightings.size(); ++i) {
    if (sightings[i].camera != camera) continue;
    const Eigen::Vector2d from = scale * sightings[i].pixel_px;
    const Eigen::Vector2d residual = residual_px(adjustment.survey, sightings[i]);
    if (!residual.allFinite()) continue;
    const double length = kResidualScale * residual.norm();
    const double shown = std::min(length, kLongestResidual) / std::max(length, 1e-9);
    const Eigen::Vector2d to = from + shown * kResidualScale * residual;
    out += fmt::format(
        "<path d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\" stroke=\"{}\" "
        "stroke-width=\"0.8\"/>\n",
        from.x(), from.y(), to.x(), to.y(), adjustment.outlier[i] ? "#c4232b" : "#1c2329");
  }
  if (judged.next) {
    out += "<polygon points=\"";
    for (Eigen::Index i = 0; i < judged.next->outline_px.cols(); ++i) {
      const Eigen::Vector2d corner = scale * judged.next->outline_px.col(i);
      out += fmt::format("{:.1f},{:.1f} ", corner.x(), corner.y());
    }
    out += "\" fill=\"none\" stroke=\"#22764a\" stroke-width=\"2\" stroke-dasharray=\"7 4\"/>\n";
  }
  return out + "</svg>\n";
}

void write_calibration_report(const std::string& path, const Adjustment& adjustment,
                              const Verdict& verdict, const CalibrationReport& report) {
  AtomicFile file(path);
  file.stream() << Page(adjustment, verdict, report).write();
  file.commit();
}

}  // namespace semblance
