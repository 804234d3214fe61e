#include "report_chart.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "semblance/core/html_page.h"
#include "semblance/pipeline/report.h"

namespace semblance {
namespace {

// Okabe and Ito's colours and greys that also differ in black-and-white print.
constexpr const char* k_amber = "#c77700";
constexpr const char* k_red = "#c4232b";
constexpr const char* k_green = "#2e8b57";
constexpr double k_left = 46.0, k_right = 8.0, k_top = 24.0, k_bottom = 18.0;

struct Ticks {
  double first = 0.0, step = 1.0;
  int decimals = 0;
};

/// Steps of 1, 2 or 5 times a power of ten that cut [low, high] into at most `count` parts.
Ticks round_ticks(double low, double high, int count) {
  const double raw = (high - low) / count;
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  Ticks ticks;
  for (const double factor : {1.0, 2.0, 5.0, 10.0}) {
    ticks.step = factor * power;
    if (ticks.step >= raw * (1.0 - 1e-9)) break;
  }
  ticks.first = std::ceil(low / ticks.step - 1e-9) * ticks.step;
  ticks.decimals = std::max(0, static_cast<int>(-std::floor(std::log10(ticks.step) + 1e-9)));
  return ticks;
}

/// Rounding leaves multiples of the step that print as -0.
double unsigned_zero(double value, double step) {
  return std::abs(value) < 1e-6 * step ? 0.0 : value;
}

double median_of_finite(std::vector<double> values) {
  std::erase_if(values, [](double v) { return !std::isfinite(v); });
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Range of the curve, widened by the usual band but not by a few hugely uncertain frames.
std::array<double, 2> value_range(const Series& series) {
  if (series.axis) return *series.axis;
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const double v : series.values) {
    if (!std::isfinite(v)) continue;
    low = std::min(low, v);
    high = std::max(high, v);
  }
  if (!(low <= high)) return {0.0, 1.0};
  const double band = 2.0 * median_of_finite(series.sigma);
  low -= band;
  high += band;
  const double least = std::max(1e-6, 1e-3 * std::max(std::abs(low), std::abs(high)));
  const double margin = std::max(0.06 * (high - low), least);
  return {low - margin, high + margin};
}

std::vector<Span> finite_runs(const std::vector<double>& values) {
  std::vector<Span> runs;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i])) continue;
    if (!runs.empty() && runs.back().last + 1 == i)
      runs.back().last = i;
    else
      runs.push_back({i, i});
  }
  return runs;
}

class Chart {
 public:
  Chart(const Series& series, const TimeAxis& axis, int width_px, int height_px)
      : series_(series), axis_(axis), width_(width_px), height_(height_px) {
    const auto range = value_range(series);
    low_ = range[0];
    high_ = range[1];
  }

  std::string svg() {
    out_ = fmt::format(
        "<svg class=\"chart\" viewBox=\"0 0 {} {}\" role=\"img\" data-left=\"{}\" "
        "data-right=\"{}\"><title>{}</title>\n",
        width_, height_, k_left, width_ - k_right, escape_html(series_.title));
    draw_states();
    draw_grid();
    draw_band();
    draw_curve();
    out_ += fmt::format(
        "<text class=\"name\" x=\"{}\" y=\"14\">{}<tspan class=\"unit\"> {}</tspan></text>\n",
        k_left, escape_html(series_.title), escape_html(series_.unit));
    out_ += fmt::format("<line class=\"cursor\" x1=\"-9\" x2=\"-9\" y1=\"{}\" y2=\"{}\"/></svg>\n",
                        k_top, height_ - k_bottom);
    return std::move(out_);
  }

 private:
  double x(double time_s) const {
    const double span = axis_.end_s - axis_.begin_s;
    return k_left + (time_s - axis_.begin_s) / span * (width_ - k_left - k_right);
  }
  double y(double value) const {
    const double plot = height_ - k_top - k_bottom;
    return k_top + std::clamp((high_ - value) / (high_ - low_), 0.0, 1.0) * plot;
  }

  void draw_states() {
    const double half = 0.5 * axis_.frame_s;
    for (const Span& span : lost_spans(axis_.status)) {
      const double from = x(axis_.time_s[span.first] - half),
                   to = x(axis_.time_s[span.last] + half);
      out_ += fmt::format(
          "<rect x=\"{:.1f}\" y=\"{}\" width=\"{:.1f}\" height=\"{}\" fill=\"url(#lost)\"/>\n",
          from, k_top, std::max(1.0, to - from), height_ - k_top - k_bottom);
    }
    for (std::size_t i = 0; i < axis_.status.size(); ++i)
      if (axis_.status[i] == TrackStatus::reinitialised)
        out_ += fmt::format(
            "<line x1=\"{0:.1f}\" x2=\"{0:.1f}\" y1=\"{1}\" y2=\"{2}\" stroke=\"{3}\" "
            "stroke-dasharray=\"3 2\"/>\n",
            x(axis_.time_s[i]), k_top, height_ - k_bottom, k_amber);
  }

  void draw_grid() {
    const Ticks values = round_ticks(low_, high_, height_ < 110 ? 3 : 4);
    for (double v = values.first; v <= high_; v += values.step) {
      const double shown = unsigned_zero(v, values.step);
      out_ += fmt::format(
          "<line class=\"grid\" x1=\"{0}\" x2=\"{1}\" y1=\"{2:.1f}\" y2=\"{2:.1f}\"/>"
          "<text class=\"tick\" x=\"{3}\" y=\"{4:.1f}\" text-anchor=\"end\">{5:.{6}f}</text>\n",
          k_left, width_ - k_right, y(v), k_left - 5, y(v) + 3.5, shown, values.decimals);
    }
    const Ticks times = round_ticks(axis_.begin_s, axis_.end_s, width_ > 700 ? 12 : 6);
    for (double t = times.first; t <= axis_.end_s; t += times.step)
      out_ += fmt::format(
          "<text class=\"tick\" x=\"{:.1f}\" y=\"{}\" text-anchor=\"middle\">{:.{}f} s</text>\n",
          x(t), height_ - 4, unsigned_zero(t, times.step), times.decimals);
  }

  /// Points of `values` from `run`, of which at most two per two pixels are drawn.
  std::vector<std::string> points(const std::vector<double>& values, const Span& run) const {
    const std::size_t count = run.last - run.first + 1;
    const double share = static_cast<double>(count) / static_cast<double>(values.size());
    const double pixels = share * (width_ - k_left - k_right);
    const auto begin = values.begin() + static_cast<std::ptrdiff_t>(run.first);
    const std::vector<double> part(begin, begin + static_cast<std::ptrdiff_t>(count));
    std::vector<std::string> out;
    for (const std::size_t i : keep_extremes(part, 1 + static_cast<std::size_t>(pixels / 2.0)))
      out.push_back(fmt::format("{:.1f},{:.1f}", x(axis_.time_s[run.first + i]), y(part[i])));
    return out;
  }

  void draw_band() {
    if (series_.sigma.empty()) return;
    std::vector<double> upper = series_.values, lower = series_.values;
    for (std::size_t i = 0; i < upper.size(); ++i) {
      upper[i] += 2.0 * series_.sigma[i];
      lower[i] -= 2.0 * series_.sigma[i];
    }
    for (const Span& run : finite_runs(upper)) {
      std::vector<std::string> outline = points(upper, run), back = points(lower, run);
      outline.insert(outline.end(), back.rbegin(), back.rend());
      out_ += fmt::format("<polygon class=\"band\" fill=\"{}\" points=\"{}\"/>\n", series_.colour,
                          fmt::join(outline, " "));
    }
  }

  void draw_curve() {
    for (const Span& run : finite_runs(series_.values)) {
      const std::vector<std::string> line = points(series_.values, run);
      if (line.size() == 1)
        out_ +=
            fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"1.5\" fill=\"{}\"/>\n",
                        x(axis_.time_s[run.first]), y(series_.values[run.first]), series_.colour);
      else
        out_ += fmt::format("<polyline class=\"curve\" stroke=\"{}\" points=\"{}\"/>\n",
                            series_.colour, fmt::join(line, " "));
    }
  }

  const Series& series_;
  const TimeAxis& axis_;
  int width_, height_;
  double low_ = 0.0, high_ = 1.0;
  std::string out_;
};

}  // namespace

TimeAxis::TimeAxis(const std::vector<TrackFrame>& frames) {
  constexpr double k_usual_frame_s = 0.04;  // where there is no second frame to tell
  std::vector<double> steps;
  for (const TrackFrame& frame : frames) {
    if (!time_s.empty()) steps.push_back(frame.time_s - time_s.back());
    time_s.push_back(frame.time_s);
    status.push_back(frame.status);
  }
  const double step = median_of_finite(steps);
  frame_s = step > 0.0 ? step : k_usual_frame_s;
  begin_s = (time_s.empty() ? 0.0 : time_s.front()) - 0.5 * frame_s;
  end_s = (time_s.empty() ? 0.0 : time_s.back()) + 0.5 * frame_s;
}

std::vector<Span> lost_spans(const std::vector<TrackStatus>& status) {
  std::vector<Span> spans;
  for (std::size_t i = 0; i < status.size(); ++i) {
    if (status[i] != TrackStatus::lost) continue;
    if (!spans.empty() && spans.back().last + 1 == i)
      spans.back().last = i;
    else
      spans.push_back({i, i});
  }
  return spans;
}

std::vector<std::size_t> keep_extremes(const std::vector<double>& values, std::size_t buckets) {
  std::vector<std::size_t> kept;
  const std::size_t n = values.size();
  buckets = std::clamp<std::size_t>(buckets, 1, std::max<std::size_t>(1, n));
  for (std::size_t b = 0; b < buckets; ++b) {
    const std::size_t none = n;
    std::size_t least = none, greatest = none;
    for (std::size_t i = b * n / buckets; i < (b + 1) * n / buckets; ++i) {
      if (!std::isfinite(values[i])) continue;
      if (least == none || values[i] < values[least]) least = i;
      if (greatest == none || values[i] > values[greatest]) greatest = i;
    }
    if (least == none) continue;
    kept.push_back(std::min(least, greatest));
    if (least != greatest) kept.push_back(std::max(least, greatest));
  }
  return kept;
}

std::string chart_svg(const Series& series, const TimeAxis& axis, int width_px, int height_px) {
  return Chart(series, axis, width_px, height_px).svg();
}

std::string status_strip_svg(const TimeAxis& axis, int width_px) {
  const double scale = (width_px - k_left - k_right) / (axis.end_s - axis.begin_s);
  const double half = 0.5 * axis.frame_s;
  std::string out = fmt::format(
      "<svg class=\"chart strip\" viewBox=\"0 0 {} 16\" data-left=\"{}\" data-right=\"{}\">"
      "<title>State over time</title>\n",
      width_px, k_left, width_px - k_right);
  for (std::size_t i = 0; i < axis.status.size();) {
    std::size_t last = i;
    while (last + 1 < axis.status.size() && axis.status[last + 1] == axis.status[i]) ++last;
    const double from = k_left + (axis.time_s[i] - half - axis.begin_s) * scale;
    const double to = k_left + (axis.time_s[last] + half - axis.begin_s) * scale;
    const char* colour = axis.status[i] == TrackStatus::tracked ? k_green
                         : axis.status[i] == TrackStatus::lost  ? k_red
                                                                : k_amber;
    out += fmt::format("<rect x=\"{:.1f}\" y=\"1\" width=\"{:.1f}\" height=\"14\" fill=\"{}\"/>\n",
                       from, std::max(1.5, to - from), colour);
    i = last + 1;
  }
  return out + "</svg>\n";
}

std::string chart_definitions() {
  return "<svg width=\"0\" height=\"0\" style=\"position:absolute\"><defs>"
         "<pattern id=\"lost\" width=\"6\" height=\"6\" patternUnits=\"userSpaceOnUse\" "
         "patternTransform=\"rotate(45)\"><rect width=\"6\" height=\"6\" fill=\"#fbe3e4\"/>"
         "<line x1=\"0\" y1=\"0\" x2=\"0\" y2=\"6\" stroke=\"#e9a5a8\" stroke-width=\"2\"/>"
         "</pattern></defs></svg>\n";
}

}  // namespace semblance
