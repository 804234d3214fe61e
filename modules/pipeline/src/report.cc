#include "semblance/pipeline/report.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "report_chart.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/core/html_page.h"
#include "semblance/core/version.h"

namespace semblance {
namespace {

constexpr double k_nan = std::numeric_limits<double>::quiet_NaN();
constexpr double k_degrees = 180.0 / std::numbers::pi;
constexpr int k_page_px = 1040, k_half_px = 510;
constexpr std::size_t k_shown_expressions = 12;

// Moves one time cursor over all charts. Reads the axis from the page's data attributes.
constexpr const char* k_script = R"(
(function(){
var page=document.querySelector('main'),begin=+page.dataset.begin,end=+page.dataset.end,step=+page.dataset.step;
var first=+page.dataset.first,charts=document.querySelectorAll('svg.chart'),readout=document.getElementById('readout');
charts.forEach(function(chart){
chart.addEventListener('mousemove',function(event){
var box=chart.getBoundingClientRect(),left=+chart.dataset.left,right=+chart.dataset.right;
var x=(event.clientX-box.left)/box.width*chart.viewBox.baseVal.width;
var part=Math.min(1,Math.max(0,(x-left)/(right-left))),time=begin+part*(end-begin);
charts.forEach(function(other){
var cursor=other.querySelector('.cursor'),l=+other.dataset.left,r=+other.dataset.right;
if(cursor){cursor.setAttribute('x1',l+part*(r-l));cursor.setAttribute('x2',l+part*(r-l));}
});
readout.style.visibility='visible';
readout.textContent=Math.max(0,time).toFixed(2)+' s · frame '+(first+Math.round((time-begin)/step-0.5));
});
});
})();
)";

double quantile(std::vector<double> values, double share) {
  std::erase_if(values, [](double v) { return !std::isfinite(v); });
  if (values.empty()) return k_nan;
  const auto rank =
      static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), values.begin() + rank, values.end());
  return values[static_cast<std::size_t>(rank)];
}

std::string figure_or_dash(double value, int decimals) {
  return std::isfinite(value) ? fmt::format("{:.{}f}", value, decimals) : "–";
}

/// One column of x.
struct Column {
  std::string name, unit;
};

std::vector<Column> columns_of(const nlohmann::json& header) {
  std::vector<Column> columns;
  for (const auto& entry : header.value("parameters", nlohmann::json::array()))
    columns.push_back({entry.value("name", ""), entry.value("unit", "1")});
  return columns;
}

/// Deviation of an entry of x, NaN where the frame has none.
double sigma_of(const TrackFrame& frame, Eigen::Index entry) {
  return frame.sigma.size() == 0 ? k_nan : frame.sigma[entry];
}

std::string plain(const std::string& name) {
  std::string out;
  for (const char c : name)
    if (std::isalnum(static_cast<unsigned char>(c)))
      out += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return out;
}

bool is_pose(const Column& column) {
  return column.name.starts_with("rotation") || column.name.starts_with("translation");
}

/// What the page is made of.
class Page {
 public:
  explicit Page(const ReportInput& input)
      : input_(input),
        frames_(input.track.frames),
        columns_(columns_of(input.track.header)),
        axis_(frames_) {
    for (const TrackFrame& frame : frames_) check(frame);
    for (const ReportCurve& curve : input_.curves) check(curve);
  }

  std::string html() {
    head();
    summary();
    curves();
    if (!columns_.empty()) {
      pose();
      expressions();
      fit();
      reading();
    }
    pictures();
    times();
    if (!columns_.empty()) parameters();
    settings();
    foot();
    return std::move(out_);
  }

 private:
  void check(const TrackFrame& frame) const {
    if (frame.status == TrackStatus::lost) return;
    if (frame.x.size() != static_cast<Eigen::Index>(columns_.size()) ||
        (frame.sigma.size() != 0 && frame.sigma.size() != frame.x.size()))
      throw InvalidInput(fmt::format(
          "report of {}: frame {} has {} parameters and {} deviations where the header names {}",
          input_.title, frame.frame, frame.x.size(), frame.sigma.size(), columns_.size()));
  }

  void check(const ReportCurve& curve) const {
    if (curve.values.size() != frames_.size())
      throw InvalidInput(fmt::format("report of {}: {} values of '{}' for {} frames", input_.title,
                                     curve.values.size(), curve.title, frames_.size()));
  }

  int count(TrackStatus status) const {
    return static_cast<int>(std::count(axis_.status.begin(), axis_.status.end(), status));
  }

  /// A value of every frame that has an estimate.
  template <class Value>
  std::vector<double> collect(Value value) const {
    std::vector<double> out;
    for (const TrackFrame& frame : frames_)
      out.push_back(frame.status == TrackStatus::lost ? k_nan : value(frame));
    return out;
  }

  Series column_series(std::size_t column) const {
    const auto i = static_cast<Eigen::Index>(column);
    Series series;
    series.title = columns_[column].name;
    series.unit = columns_[column].unit == "1" ? "" : columns_[column].unit;
    series.values = collect([&](const TrackFrame& f) { return f.x[i]; });
    series.sigma = collect([&](const TrackFrame& f) { return sigma_of(f, i); });
    return series;
  }

  void head() {
    out_ += html_head(input_.title + " – tracking report");
    out_ += fmt::format(
        "<body><main data-begin=\"{:.6f}\" data-end=\"{:.6f}\" data-step=\"{:.6f}\" "
        "data-first=\"{}\">\n",
        axis_.begin_s, axis_.end_s, axis_.frame_s, frames_.empty() ? 0 : frames_[0].frame);
    out_ += chart_definitions();
    const auto size = input_.track.header.value("frame_size", nlohmann::json::array());
    const std::string picture = size.size() == 2
                                    ? fmt::format(", {} × {} pixels", escape_html(size[0].dump()),
                                                  escape_html(size[1].dump()))
                                    : "";
    out_ += fmt::format(
        "<h1>{}</h1>\n<p class=\"sub\">Tracking report, {}{}, {} frames, {:.2f} s</p>\n",
        escape_html(input_.title), escape_html(input_.track.header.value("kind", "unknown kind")),
        picture, frames_.size(), frames_.empty() ? 0.0 : axis_.end_s - axis_.begin_s);
  }

  void card(const std::string& figure, const std::string& label, const char* kind = "") {
    out_ += html_card(figure, label, kind);
  }

  void summary() {
    const int lost = count(TrackStatus::lost), again = count(TrackStatus::reinitialised);
    const int total = static_cast<int>(frames_.size());
    const auto spans = lost_spans(axis_.status);
    out_ += "<div class=\"cards\">\n";
    card(fmt::format("{:.1f} %", total == 0 ? 0.0 : 100.0 * (total - lost) / total),
         fmt::format("{} of {} frames with an estimate", total - lost, total),
         lost == 0 ? "good" : "");
    card(std::to_string(lost),
         spans.empty() ? "frames lost"
                       : fmt::format("frames lost, in {} {}", spans.size(),
                                     spans.size() == 1 ? "span" : "spans"),
         lost > 0 ? "bad" : "good");
    card(std::to_string(again), again == 1 ? "reinitialisation" : "reinitialisations",
         again > 0 ? "warn" : "");
    card(figure_or_dash(quantile(residuals(), 0.5), 4), "median residual (rms)");
    card(figure_or_dash(100.0 * quantile(inliers(), 0.5), 0) + " %",
         columns_.empty() ? "median inliers" : "median inlier pixels");
    if (input_.wall_s > 0.0)
      card(fmt::format("{:.1f}/s", total / input_.wall_s),
           fmt::format("frames, {:.1f} s in all", input_.wall_s));
    out_ += "</div>\n" + status_strip_svg(axis_, k_page_px);
    out_ +=
        "<p class=\"legend\"><span><i style=\"background:#2e8b57\"></i>tracked</span>"
        "<span><i style=\"background:#c4232b\"></i>lost: no estimate</span>"
        "<span><i style=\"background:#c77700\"></i>reinitialised</span></p>\n";
    if (!spans.empty()) list_lost(spans);
  }

  void list_lost(const std::vector<Span>& spans) {
    constexpr std::size_t k_listed = 40;
    std::vector<std::string> texts;
    for (const Span& span : spans) {
      if (texts.size() == k_listed) break;
      const TrackFrame &first = frames_[span.first], &last = frames_[span.last];
      texts.push_back(span.first == span.last
                          ? fmt::format("frame {} ({:.2f} s)", first.frame, first.time_s)
                          : fmt::format("frames {} to {} ({:.2f} to {:.2f} s)", first.frame,
                                        last.frame, first.time_s, last.time_s));
    }
    if (spans.size() > k_listed)
      texts.push_back(fmt::format("and {} more", spans.size() - k_listed));
    out_ += fmt::format("<p class=\"note\">Lost: {}.</p>\n", fmt::join(texts, ", "));
  }

  void legend() {
    out_ +=
        "<p class=\"legend\"><span><i style=\"background:#0b5cad33;border-top:2px solid "
        "#0b5cad\"></i>estimate and ± 2 σ</span>"
        "<span><i style=\"background:#f2c4c6\"></i>lost</span>"
        "<span><i style=\"border-left:2px dashed "
        "#c77700;width:6px\"></i>reinitialised</span></p>\n";
  }

  void curves() {
    if (input_.curves.empty()) return;
    out_ += "<h2>Over time</h2>\n";
    for (const ReportCurve& curve : input_.curves) {
      Series series{curve.title, curve.unit, curve.values, {}, "#0b5cad", {}};
      if (curve.from_zero) {
        series.axis = {{0.0, std::max(1e-4, 1.1 * quantile(curve.values, 1.0))}};
      }
      out_ += chart_svg(series, axis_, k_page_px, 150);
    }
  }

  void pose() {
    out_ += "<h2>Head pose</h2>\n";
    legend();
    static constexpr std::array<const char*, 3> angles{"Yaw (+ to its own left)", "Pitch (+ up)",
                                                       "Roll (+ to its right shoulder)"};
    for (int axis = 0; axis < 3; ++axis) {
      Series series;
      series.title = angles[static_cast<std::size_t>(axis)];
      series.unit = "degrees";
      series.values = collect(
          [&](const TrackFrame& f) { return k_degrees * head_angles(f.rotation_wxyz)[axis]; });
      series.sigma = angle_sigma(axis);
      out_ += chart_svg(series, axis_, k_page_px, 118);
    }
    static constexpr std::array<const char*, 3> places{"Position x (to the right in the picture)",
                                                       "Position y (up)",
                                                       "Position z (towards the camera)"};
    for (int axis = 0; axis < 3; ++axis) {
      Series series;
      series.title = places[static_cast<std::size_t>(axis)];
      series.unit = "cm";
      series.values = collect([&](const TrackFrame& f) { return 100.0 * f.translation_m[axis]; });
      if (const auto column = find_column(fmt::format("translation[{}]", axis)))
        series.sigma = collect([&](const TrackFrame& f) { return 100.0 * sigma_of(f, *column); });
      out_ += chart_svg(series, axis_, k_page_px, 118);
    }
  }

  std::optional<Eigen::Index> find_column(const std::string& name) const {
    for (std::size_t i = 0; i < columns_.size(); ++i)
      if (columns_[i].name == name) return static_cast<Eigen::Index>(i);
    return std::nullopt;
  }

  std::vector<double> angle_sigma(int axis) const {
    const auto first = find_column("rotation[0]");
    if (!first) return {};
    return collect([&](const TrackFrame& frame) {
      Eigen::Vector4d sigma;
      for (int k = 0; k < 4; ++k) sigma[k] = sigma_of(frame, *first + k);
      return k_degrees * head_angles_sigma(frame.rotation_wxyz, sigma)[axis];
    });
  }

  /// The best known expressions where the model names them, else those that move most.
  std::vector<std::size_t> shown_expressions() const {
    static constexpr std::array<const char*, 9> known{"jawopen",     "eyeblink",    "mouthsmile",
                                                      "browinnerup", "browouterup", "browdown",
                                                      "mouthfunnel", "mouthpucker", "mouthclose"};
    std::vector<std::size_t> shown;
    for (const char* prefix : known)
      for (std::size_t i = 0; i < columns_.size(); ++i)
        if (plain(columns_[i].name).starts_with(prefix) && moves(i)) shown.push_back(i);
    if (shown.empty()) {
      for (std::size_t i = 0; i < columns_.size(); ++i)
        if (!is_pose(columns_[i]) && moves(i)) shown.push_back(i);
      std::stable_sort(shown.begin(), shown.end(),
                       [&](std::size_t a, std::size_t b) { return spread(a) > spread(b); });
    }
    if (shown.size() > k_shown_expressions) shown.resize(k_shown_expressions);
    return shown;
  }

  double spread(std::size_t column) const {
    const auto values = column_series(column).values;
    return quantile(values, 0.95) - quantile(values, 0.05);
  }
  bool moves(std::size_t column) const { return spread(column) > 0.0; }

  void expressions() {
    const auto shown = shown_expressions();
    if (shown.empty()) return;
    out_ += "<h2>Expression</h2>\n<div class=\"pair\">\n";
    for (const std::size_t column : shown)
      out_ += chart_svg(column_series(column), axis_, k_half_px, 104);
    out_ += "</div>\n";
  }

  std::vector<double> residuals() const {
    return collect([](const TrackFrame& f) { return f.residual_rms; });
  }
  std::vector<double> inliers() const {
    return collect([](const TrackFrame& f) { return f.inlier_fraction; });
  }

  void fit() {
    out_ += "<h2>Fit</h2>\n";
    Series residual{"Residual of the picture (rms, 0 to 1)", "", residuals(), {}, "#5b3a8c", {}};
    residual.axis = {{0.0, std::max(1e-4, 1.1 * quantile(residual.values, 1.0))}};
    Series inlier{"Inlier pixels", "%", inliers(), {}, "#5b3a8c", {{0.0, 104.0}}};
    for (double& v : inlier.values) v *= 100.0;
    out_ += chart_svg(residual, axis_, k_page_px, 118) + chart_svg(inlier, axis_, k_page_px, 118);
  }

  void reading() {
    out_ +=
        "<h2>How to read σ</h2>\n"
        "<p>The band is the estimate ± 2 standard deviations. They come from the curvature of the "
        "cost at the solution and the size of its residuals: how firmly this one picture holds "
        "the parameter. If the model were exact and the noise Gaussian, 95 % of the bands would "
        "contain the truth.</p>\n"
        "<p>They do not contain what the model cannot say: a wrong focal length scales "
        "every distance alike, a wrong face shape shifts all frames together, a shadow "
        "explained as an expression looks certain. Compare bands between frames and parameters; "
        "do not quote them as accuracy. A wide band marks a parameter that the picture hardly "
        "shows "
        "(a profile's far eyelid); there the prior decides, and the value means little. A band is "
        "cut where it leaves the chart, and missing where no deviation was computed.</p>\n"
        "<p>Inlier pixels are those that the robust weights trust. A dip with a steady pose is a "
        "hand or a highlight; a dip together with a rising residual deserves a look at the "
        "pictures below.</p>\n";
  }

  void sheet(const std::string& title, const std::string& note,
             const std::vector<Thumbnail>& list) {
    if (list.empty()) return;
    out_ += fmt::format("<h2>{}</h2>\n<p class=\"note\">{}</p>\n<div class=\"sheet\">\n",
                        escape_html(title), escape_html(note));
    for (const Thumbnail& t : list) {
      const std::string quality = t.status == TrackStatus::tracked
                                      ? fmt::format("residual {:.4f}", t.residual_rms)
                                      : to_string(t.status);
      out_ += fmt::format(
          "<figure><img width=\"{}\" height=\"{}\" alt=\"frame {}\" "
          "src=\"data:image/jpeg;base64,{}\"/>"
          "<figcaption>frame {} · {:.2f} s · {}</figcaption></figure>\n",
          t.width, t.height, t.frame, base64(t.jpeg), t.frame, t.time_s, escape_html(quality));
    }
    out_ += "</div>\n";
  }

  void pictures() {
    sheet("Worst frames",
          columns_.empty() ? "Highest residual first, at most one per ten frames."
                           : "Highest residual first, at most one per ten frames; cut to the head.",
          input_.pictures.worst());
    sheet("Lost and found", "The first frames where tracking was lost or began anew.",
          input_.pictures.changes());
    sheet("Evenly spaced", "The whole clip at a glance.", input_.pictures.spaced());
  }

  void times() {
    if (input_.stages.empty()) return;
    double longest = 0.0;
    for (const StageTime& stage : input_.stages) longest = std::max(longest, stage.seconds);
    const double frames = std::max<double>(1.0, static_cast<double>(frames_.size()));
    out_ +=
        "<h2>Time per stage</h2>\n<p class=\"note\">Stages on threads of their own overlap, so "
        "the sum can exceed the run.</p>\n<table><tr><th>stage</th><th class=\"n\">seconds</th>"
        "<th class=\"n\">ms per frame</th><th></th></tr>\n";
    for (const StageTime& stage : input_.stages)
      out_ += fmt::format(
          "<tr><td>{}</td><td class=\"n\">{:.2f}</td><td class=\"n\">{:.2f}</td><td "
          "style=\"width:320px\"><span class=\"bar\" style=\"width:{:.1f}%\"></span></td></tr>\n",
          escape_html(stage.name), stage.seconds, 1e3 * stage.seconds / frames,
          longest > 0.0 ? 100.0 * stage.seconds / longest : 0.0);
    if (input_.wall_s > 0.0)
      out_ += fmt::format(
          "<tr><th>whole run</th><td class=\"n\">{:.2f}</td><td "
          "class=\"n\">{:.2f}</td><td></td></tr>\n",
          input_.wall_s, 1e3 * input_.wall_s / frames);
    out_ += "</table>\n";
  }

  void parameters() {
    out_ +=
        "<h2>Parameters</h2>\n<details><summary>All parameters over the clip</summary>\n"
        "<table><tr><th>name</th><th>unit</th><th class=\"n\">5 %</th><th "
        "class=\"n\">median</th><th class=\"n\">95 %</th><th class=\"n\">median σ</th></tr>\n";
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      const Series series = column_series(i);
      out_ += fmt::format(
          "<tr><td>{}</td><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td>"
          "<td class=\"n\">{}</td><td class=\"n\">{}</td></tr>\n",
          escape_html(columns_[i].name), escape_html(columns_[i].unit),
          figure_or_dash(quantile(series.values, 0.05), 4),
          figure_or_dash(quantile(series.values, 0.5), 4),
          figure_or_dash(quantile(series.values, 0.95), 4),
          figure_or_dash(quantile(series.sigma, 0.5), 5));
    }
    out_ += "</table></details>\n";
  }

  void settings() {
    out_ += "<h2>Settings</h2>\n<table>\n";
    const nlohmann::json& header = input_.track.header;
    for (const char* key : {"program", "schema", "seed", "cameras"})
      if (header.contains(key)) setting(key, header[key]);
    if (header.contains("config")) setting("", header["config"]);
    out_ += "</table>\n";
  }

  /// One row per leaf, named by its path.
  void setting(const std::string& path, const nlohmann::json& value) {
    if (value.is_object()) {
      for (const auto& [key, inner] : value.items())
        setting(path.empty() ? key : path + "." + key, inner);
    } else if (value.is_array() && !value.empty() && value[0].is_object()) {
      for (std::size_t i = 0; i < value.size(); ++i)
        setting(fmt::format("{}[{}]", path, i), value[i]);
    } else {
      const std::string text = value.is_string() ? value.get<std::string>() : value.dump();
      out_ +=
          fmt::format("<tr><td>{}</td><td>{}</td></tr>\n", escape_html(path), escape_html(text));
    }
  }

  void foot() {
    out_ += fmt::format(
        "<footer>Written by {}. The figures are in track.jsonl{} beside "
        "this page.</footer>\n</main><div id=\"readout\"></div>\n"
        "<script>{}</script></body></html>\n",
        program_version(), columns_.empty() ? "" : " and track.csv", k_script);
  }

  const ReportInput& input_;
  const std::vector<TrackFrame>& frames_;
  std::vector<Column> columns_;
  TimeAxis axis_;
  std::string out_;
};

}  // namespace

Eigen::Vector3d head_angles(const Eigen::Vector4d& rotation_wxyz) {
  const Eigen::Vector4d q = rotation_wxyz.normalized();
  const Eigen::Matrix3d R = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix();
  // R = Ry(a) Rx(b) Rz(c): third column (sin a cos b, -sin b, cos a cos b), second row
  // (cos b sin c, cos b cos c, -sin b).
  return {std::atan2(R(0, 2), R(2, 2)), std::asin(std::clamp(R(1, 2), -1.0, 1.0)),
          std::atan2(R(1, 0), R(1, 1))};
}

Eigen::Vector3d head_angles_sigma(const Eigen::Vector4d& rotation_wxyz,
                                  const Eigen::Vector4d& sigma) {
  constexpr double k_step = 1e-5;  // central differences: error of the order of its square
  Eigen::Vector3d variance = Eigen::Vector3d::Zero();
  for (int k = 0; k < 4; ++k) {
    const Eigen::Vector4d step = k_step * Eigen::Vector4d::Unit(k);
    Eigen::Vector3d turn = head_angles(rotation_wxyz + step) - head_angles(rotation_wxyz - step);
    for (double& angle : turn) angle = std::remainder(angle, 2.0 * std::numbers::pi);
    variance += (turn / (2.0 * k_step) * sigma[k]).cwiseAbs2();
  }
  return variance.cwiseSqrt();
}

void write_report(const std::string& path, const ReportInput& input) {
  const std::string html = Page(input).html();
  AtomicFile file(path);
  file.stream() << html;
  file.commit();
}

}  // namespace semblance
