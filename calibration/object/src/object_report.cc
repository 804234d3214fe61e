#include "semblance/object/object_report.h"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <numbers>

#include "semblance/core/atomic_file.h"
#include "semblance/core/html_page.h"
#include "semblance/core/version.h"
#include "semblance/io/image_io.h"

namespace semblance {
namespace {

constexpr double kDegrees = 180.0 / std::numbers::pi;

class Page {
 public:
  Page(const std::vector<ObjectPicture>& pictures, const ObjectCalibration& calibration,
       const std::vector<Rgb8>& overlays)
      : pictures_(pictures), calibration_(calibration), overlays_(overlays) {}

  std::string write(const std::string& title) {
    out_ = html_head(title + " – object calibration");
    out_ += fmt::format(
        "<body><main>\n<h1>{}</h1>\n<p class=\"sub\">Camera and poses of a known "
        "object in {} picture{}</p>\n",
        escape_html(title), pictures_.size(), pictures_.size() == 1 ? "" : "s");
    cards();
    notes();
    camera();
    for (std::size_t k = 0; k < pictures_.size(); ++k) picture(k);
    out_ +=
        "<h2>How to read this page</h2>\n<p class=\"note\">Crosses are the pairs as given, red "
        "lines lead to where the estimate has their points. The left half shows the estimate "
        "from pairs alone, the right one that after comparison with the picture. Deviations "
        "follow from the scatter of what the comparison left over; they hold if the mesh is "
        "right.</p>\n";
    out_ +=
        fmt::format("<footer>Written by {}.</footer>\n</main></body></html>\n", program_version());
    return out_;
  }

 private:
  void cards() {
    const ObjectEstimate& best = calibration_.best();
    out_ += "<div class=\"cards\">\n";
    out_ += html_card(fmt::format("{:.1f} px", best.camera.focal_px.x()),
                      best.focal_free
                          ? fmt::format("focal length, ± {:.1f} px (σ)", best.intrinsics_sigma[0])
                          : std::string("focal length, kept"));
    out_ += html_card(fmt::format("{:.2f} px", best.pairs_rms_px), "pairs (rms)");
    double worst_px = 0.0;
    for (const ObjectFit& fit : calibration_.fits)
      worst_px = std::max(worst_px, fit.outline_rms_px);
    if (calibration_.refined) {
      out_ += html_card(fmt::format("{:.2f} px", worst_px), "outline to edges (rms, worst)");
    }
    out_ += "</div>\n";
  }

  void notes() {
    if (calibration_.notes.empty()) return;
    out_ += "<h2>Warnings</h2>\n<ul>\n";
    for (const std::string& note : calibration_.notes) {
      out_ += "<li>" + escape_html(note) + "</li>\n";
    }
    out_ += "</ul>\n";
  }

  static std::string with_sigma(double value, double sigma) {
    return sigma > 0.0 ? fmt::format("{:.6g} ± {:.3g}", value, sigma)
                       : fmt::format("{:.6g} kept", value);
  }

  static std::vector<std::string> intrinsics(const ObjectEstimate& estimate) {
    const Camera& camera = estimate.camera;
    std::vector<double> values{camera.focal_px.x(), camera.focal_px.y(), camera.principal_px.x(),
                               camera.principal_px.y()};
    for (int k = 0; k < coefficient_count(camera.lens); ++k) {
      values.push_back(camera.distortion[static_cast<std::size_t>(k)]);
    }
    std::vector<std::string> out;
    for (std::size_t i = 0; i < values.size(); ++i) {
      out.push_back(with_sigma(values[i], estimate.intrinsics_sigma[static_cast<Eigen::Index>(i)]));
    }
    return out;
  }

  void camera() {
    const auto pairs = intrinsics(calibration_.from_pairs), best = intrinsics(calibration_.best());
    const Lens lens = calibration_.best().camera.lens;
    out_ +=
        "<h2>Camera</h2>\n<table><tr><th>parameter</th><th>from pairs</th><th>result</th></tr>\n";
    for (std::size_t i = 0; i < best.size(); ++i) {
      constexpr const char* names[] = {"f<sub>x</sub>, px", "f<sub>y</sub>, px",
                                       "c<sub>x</sub>, px", "c<sub>y</sub>, px"};
      out_ += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td></tr>\n",
                          i < 4 ? std::string(names[i])
                                : std::string(coefficient_name(lens, static_cast<int>(i) - 4)),
                          i < pairs.size() ? pairs[i] : "", best[i]);
    }
    out_ += "</table>\n";
  }

  void pose_row(const char* name, const ObjectPose& pose) {
    const Eigen::Vector3d turn =
        kDegrees * rotation_vector_from_quaternion(pose.camera_from_object.rotation);
    const Eigen::Vector3d place = 1e3 * pose.camera_from_object.translation_m;
    const auto sigma = pose.covariance.diagonal().cwiseSqrt().eval();
    out_ += fmt::format("<tr><td>{}</td>", name);
    for (int k = 0; k < 3; ++k) {
      out_ += fmt::format("<td class=\"n\">{:.3f} ± {:.2g}</td>", turn[k], kDegrees * sigma[k]);
    }
    for (int k = 0; k < 3; ++k) {
      out_ += fmt::format("<td class=\"n\">{:.2f} ± {:.2g}</td>", place[k], 1e3 * sigma[3 + k]);
    }
    out_ += "</tr>\n";
  }

  void picture(std::size_t k) {
    const std::string name = std::filesystem::path(pictures_[k].name).filename().string();
    out_ += fmt::format("<h2>{}</h2>\n", escape_html(name));
    if (k < calibration_.fits.size()) {
      const ObjectFit& fit = calibration_.fits[k];
      out_ += fmt::format(
          "<p class=\"sub\">edges found along {:.0f} % of the outline, {:.2f} px off "
          "(rms){}; {} of {} pairs are outliers</p>\n",
          100.0 * fit.outline_share, fit.outline_rms_px,
          fit.colour_rms > 0.0 ? fmt::format("; colours agree to {:.3f} (correlation {:.3f})",
                                             fit.colour_rms, fit.colour_correlation)
                               : "",
          fit.outlier_pairs, pictures_[k].pairs.size());
    }
    out_ +=
        "<table><tr><th></th><th class=\"n\" colspan=\"3\">turn (rotation vector), degrees</th>"
        "<th class=\"n\" colspan=\"3\">place of the mesh's origin (camera's x, y, z), mm</th>"
        "</tr>\n";
    pose_row("from pairs", calibration_.from_pairs.poses[k]);
    if (calibration_.refined) pose_row("result", calibration_.refined->poses[k]);
    out_ += fmt::format(
        "</table>\n<figure><img alt=\"{}\" src=\"data:image/jpeg;base64,{}\"/>"
        "</figure>\n",
        escape_html(name), base64(encode_image(overlays_[k], ImageFormat::jpeg)));
  }

  const std::vector<ObjectPicture>& pictures_;
  const ObjectCalibration& calibration_;
  const std::vector<Rgb8>& overlays_;
  std::string out_;
};

}  // namespace

void write_object_report(const std::string& path, const std::string& title,
                         const std::vector<ObjectPicture>& pictures,
                         const ObjectCalibration& calibration, const std::vector<Rgb8>& overlays) {
  AtomicFile file(path);
  file.stream() << Page(pictures, calibration, overlays).write(title);
  file.commit();
}

}  // namespace semblance
