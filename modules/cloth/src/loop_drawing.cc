#include "semblance/cloth/loop_drawing.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "semblance/core/atomic_file.h"
#include "semblance/core/html_page.h"

namespace semblance {
namespace {

constexpr double k_width = 1320.0, k_height = 950.0, k_top = 104.0;
constexpr double k_cell_width = k_width / 3.0, k_cell_height = (k_height - k_top) / 2.0;
constexpr const char* k_given_colour = "#8db4d8";
constexpr const char* k_tested_colour = "#b3261e";
/// Where the residual of a figure is coloured.
constexpr double k_notable_pct = 3.0;

struct Span {
  double low = 0.0, high = 0.0;

  void include(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  double length() const { return high - low; }
};

/// 1, 2 or 5 times a power of ten, so that up to nine steps make the span.
double tick_step(double length) {
  const double raw = length / 9.0, power = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (raw <= factor * power * 1.0001) return factor * power;
  }
  return 10.0 * power;
}

std::string tick_text(double value, double step) {
  const int decimals = std::clamp(static_cast<int>(std::ceil(-std::log10(step) - 1e-9)), 0, 6);
  const std::string text = fmt::format("{:.{}f}", value == 0.0 ? 0.0 : value, decimals);
  return text[0] == '-' ? "\u2212" + text.substr(1) : text;
}

struct Panel {
  const char* title;
  const char* x_label;
  const char* y_label;
  double x_unit, y_unit;  // SI from those of the labels
  int column, row;
};

class PanelDrawing {
 public:
  PanelDrawing(const Panel& panel, const Loop& given, const Loop& tested, const Loop& readings)
      : panel_(panel) {
    for (const Loop* loop : {&given, &tested}) {
      for (const LoopSample& sample : *loop) {
        x_.include(sample.deformation / panel.x_unit);
        y_.include(sample.force / panel.y_unit);
      }
    }
    widen(x_, 0.02);
    widen(y_, 0.05);
    left_ = panel.column * k_cell_width + 76.0;
    top_ = k_top + panel.row * k_cell_height + 34.0;
    frame();
    if (given.empty() && tested.empty()) {
      text(left_ + 0.5 * width(), top_ + 0.5 * height(), "not tested", "text-anchor='middle'");
    } else if (given.empty()) {
      text(left_ + width() - 8.0, top_ + height() - 10.0, "not given: assumed",
           "text-anchor='end' fill='#777' font-style='italic'");
    }
    line(given, k_given_colour, 6.0);
    if (readings.size() < 60) dots(readings);
    line(tested, k_tested_colour, 1.6);
  }

  const std::string& svg() const { return out_; }

 private:
  static double width() { return k_cell_width - 100.0; }
  static double height() { return k_cell_height - 100.0; }

  static void widen(Span& span, double part) {
    if (!(span.length() > 0.0)) span.high = span.low + 1.0;
    const double margin = part * span.length();
    if (span.low < 0.0) span.low -= margin;
    span.high += margin;
  }

  double px(double x) const { return left_ + width() * (x - x_.low) / x_.length(); }
  double py(double y) const { return top_ + height() * (1.0 - (y - y_.low) / y_.length()); }

  void text(double x, double y, const std::string& what, const char* style) {
    out_ += fmt::format("<text x='{:.1f}' y='{:.1f}' {}>{}</text>\n", x, y, style, what);
  }
  void segment(double x1, double y1, double x2, double y2, const char* colour) {
    out_ += fmt::format("<path d='M{:.1f} {:.1f}L{:.1f} {:.1f}' stroke='{}'/>\n", x1, y1, x2, y2,
                        colour);
  }

  void frame() {
    const double right = left_ + width(), bottom = top_ + height();
    for (const bool along_x : {true, false}) ticks(along_x);
    out_ += fmt::format(
        "<rect x='{:.1f}' y='{:.1f}' width='{:.1f}' height='{:.1f}' fill='none' stroke='#555'/>\n",
        left_, top_, width(), height());
    text(left_, top_ - 10.0, panel_.title, "font-weight='bold' font-size='16'");
    text(0.5 * (left_ + right), bottom + 40.0, panel_.x_label, "text-anchor='middle'");
    out_ += fmt::format(
        "<text transform='translate({:.1f} {:.1f}) rotate(-90)' text-anchor='middle'>{}</text>\n",
        left_ - 54.0, 0.5 * (top_ + bottom), panel_.y_label);
  }

  void ticks(bool along_x) {
    const Span& span = along_x ? x_ : y_;
    const double step = tick_step(span.length()), right = left_ + width(), bottom = top_ + height();
    const int first = static_cast<int>(std::ceil(span.low / step - 1e-9));
    const int last = static_cast<int>(std::floor(span.high / step + 1e-9));
    for (int i = first; i <= last; ++i) {
      const double value = i * step;
      const char* const colour = i == 0 ? "#999" : "#e4e4e4";
      const std::string label = tick_text(value, step);
      if (along_x) {
        segment(px(value), top_, px(value), bottom, colour);
        text(px(value), bottom + 18.0, label, "text-anchor='middle' class='tick'");
      } else {
        segment(left_, py(value), right, py(value), colour);
        text(left_ - 7.0, py(value) + 4.5, label, "text-anchor='end' class='tick'");
      }
    }
  }

  /// Steady loops jump at their turns; what no test passed through is not drawn.
  void line(const Loop& loop, const char* colour, double stroke) {
    if (loop.empty()) return;
    std::string path;
    for (std::size_t i = 0; i < loop.size(); ++i) {
      const bool jumps = i == 0 || loop[i].deformation == loop[i - 1].deformation;
      path +=
          fmt::format("{}{:.1f} {:.1f}", jumps ? "M" : "L", px(loop[i].deformation / panel_.x_unit),
                      py(loop[i].force / panel_.y_unit));
    }
    out_ += fmt::format(
        "<path d='{}' fill='none' stroke='{}' stroke-width='{}' stroke-linejoin='round'/>\n", path,
        colour, stroke);
  }

  void dots(const Loop& loop) {
    for (const LoopSample& sample : loop) {
      out_ += fmt::format(
          "<circle cx='{:.1f}' cy='{:.1f}' r='4.5' fill='#fff' stroke='{}' "
          "stroke-width='2'/>\n",
          px(sample.deformation / panel_.x_unit), py(sample.force / panel_.y_unit), k_given_colour);
    }
  }

  Panel panel_;
  Span x_, y_;
  double left_ = 0.0, top_ = 0.0;
  std::string out_;
};

std::string with_superscripts(const char* unit) {
  std::string text = unit;
  for (std::size_t at = text.find("cm2"); at != std::string::npos; at = text.find("cm2")) {
    text.replace(at, 3, "cm\u00b2");
  }
  return text;
}

std::string signed_text(double value) {
  const std::string text = fmt::format("{:+.2f}", value);
  if (text == "+0.00" || text == "-0.00") return "0.00";
  return text[0] == '-' ? "\u2212" + text.substr(1) : text;
}

class Table {
 public:
  explicit Table(const LoopDrawing& drawing) {
    row({"Figure", "Unit", "Given", "Test", "Residual %"}, "font-weight='bold'", nullptr);
    rule();
    const char* before = nullptr;
    for (const FigureComparison& figure : drawing.figures) {
      if (before != nullptr && std::string(before) != figure.name.direction) rule();
      before = figure.name.direction;
      const auto residual = figure.residual_pct();
      const bool notable = residual && std::abs(*residual) > k_notable_pct;
      row({fmt::format("{} {}", figure.name.symbol, figure.name.direction),
           with_superscripts(figure.name.unit),
           figure.given ? figure_text(*figure.given) : "\u2013", figure_text(figure.reproduced),
           residual ? signed_text(*residual) : "\u2013"},
          "", notable ? k_tested_colour : nullptr);
    }
  }

  const std::string& svg() const { return out_; }

 private:
  static constexpr double left() { return 2.0 * k_cell_width + 22.0; }

  void row(const std::array<std::string, 5>& cells, const char* style, const char* colour) {
    constexpr double places[] = {0.0, 92.0, 238.0, 304.0, 396.0};
    for (std::size_t i = 0; i < cells.size(); ++i) {
      out_ += fmt::format(
          "<text x='{:.1f}' y='{:.1f}' text-anchor='{}' {}{}>{}</text>\n", left() + places[i], y_,
          i < 2 ? "start" : "end", style,
          i == 4 && colour != nullptr ? fmt::format(" font-weight='bold' fill='{}'", colour) : "",
          cells[i]);
    }
    y_ += 22.0;
  }

  void rule() {
    out_ += fmt::format("<path d='M{:.1f} {:.1f}h396' stroke='#bbb'/>\n", left(), y_ - 14.0);
    y_ += 3.0;
  }

  double y_ = k_top + k_cell_height + 24.0;
  std::string out_;
};

std::string legend(const LoopDrawing& drawing) {
  const double y = 84.0;
  std::string text = fmt::format(
      "<path d='M76 {0}h44' stroke='{1}' stroke-width='6'/>\n<text x='128' y='{2}'>{3}</text>\n", y,
      k_given_colour, y + 5.0, escape_html(drawing.given_label));
  const double second = 170.0 + 8.0 * static_cast<double>(drawing.given_label.size());
  return text + fmt::format(
                    "<path d='M{0:.0f} {1}h44' stroke='{2}' stroke-width='1.6'/>\n<text "
                    "x='{3:.0f}' y='{4}'>{5}</text>\n",
                    second, y, k_tested_colour, second + 52.0, y + 5.0,
                    escape_html(drawing.tested_label));
}

}  // namespace

std::string figure_text(double value) {
  const double size = std::abs(value);
  const int decimals = size >= 100.0 ? 1 : size >= 10.0 ? 2 : size >= 0.1 || size == 0.0 ? 3 : 4;
  return fmt::format("{:.{}f}", value, decimals);
}

std::string loops_svg(const LoopDrawing& drawing) {
  const Panel tension{"Tension along warp",
                      "Strain (%)",
                      "Force (gf/cm)",
                      kes::strain_from_pct,
                      kes::n_m_from_gf_cm,
                      0,
                      0};
  const Panel shear{
      "Shear", "Angle (deg)", "Force (gf/cm)", kes::rad_from_deg, kes::n_m_from_gf_cm, 2, 0};
  const Panel bending{"Bending along warp",
                      "Curvature (1/cm)",
                      "Moment (gf cm/cm)",
                      kes::per_m_from_per_cm,
                      kes::n_from_gf_cm_cm,
                      0,
                      1};
  Panel tension_weft = tension, bending_weft = bending;
  tension_weft.title = "Tension along weft";
  bending_weft.title = "Bending along weft";
  tension_weft.column = bending_weft.column = 1;
  std::string out = fmt::format(
      "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {0} {1}' width='{0}' height='{1}' "
      "font-family='sans-serif' font-size='14' fill='#222'>\n<style>.tick{{font-size:12.5px;"
      "fill:#444}}</style>\n<rect width='100%' height='100%' fill='#fff'/>\n"
      "<text x='22' y='34' font-size='22' font-weight='bold'>{2}</text>\n"
      "<text x='22' y='58' fill='#555'>{3}</text>\n",
      k_width, k_height, escape_html(drawing.title), escape_html(drawing.subtitle));
  out += legend(drawing);
  const KesLoops &given = drawing.given, &tested = drawing.tested, &dots = drawing.readings;
  out += PanelDrawing(tension, given.tension[warp], tested.tension[warp], dots.tension[warp]).svg();
  out += PanelDrawing(tension_weft, given.tension[weft], tested.tension[weft], dots.tension[weft])
             .svg();
  out += PanelDrawing(shear, given.shear, tested.shear, dots.shear).svg();
  out += PanelDrawing(bending, given.bending[warp], tested.bending[warp], dots.bending[warp]).svg();
  out += PanelDrawing(bending_weft, given.bending[weft], tested.bending[weft], dots.bending[weft])
             .svg();
  return out + Table(drawing).svg() + "</svg>\n";
}

void write_loops_svg(const std::string& path, const LoopDrawing& drawing) {
  AtomicFile file(path);
  file.stream() << loops_svg(drawing);
  file.commit();
}

}  // namespace semblance
