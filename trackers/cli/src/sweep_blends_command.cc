// Draws the blending functions (report, Figures 7 and 8).
#include <fmt/format.h>

#include <memory>
#include <vector>

#include "commands.h"
#include "semblance/core/atomic_file.h"
#include "semblance/geometry/homotopy.h"

namespace semblance::cli {

namespace {

struct BlendsOptions {
  std::string form = "flat", picture;
  std::vector<double> n = {-0.9, -0.7, -0.5, 0, 2, 5, 9};
};

constexpr double side_px = 400.0, margin_px = 46.0;

double x_px(double v) { return margin_px + side_px * v; }
double y_px(double r) { return margin_px + side_px * (1.0 - r); }

std::string grid() {
  std::string out;
  for (int i = 0; i <= 4; ++i) {
    const double t = 0.25 * i;
    out += fmt::format(
        "<path d='M{0} {2}V{3}M{1} {4}H{5}' stroke='#ddd'/>"
        "<text x='{0}' y='{6}' text-anchor='middle'>{7}</text>"
        "<text x='{8}' y='{9}' text-anchor='end'>{7}</text>\n",
        x_px(t), y_px(t), y_px(0), y_px(1), x_px(0), x_px(1), y_px(0) + 18, t, x_px(0) - 7,
        y_px(t) + 4);
  }
  return out;
}

std::string curve(BlendForm form, double n, int index, int count) {
  std::string points;
  for (int i = 0; i <= 80; ++i) {
    const double v = i / 80.0;
    points += fmt::format("{:.1f},{:.1f} ", x_px(v), y_px(blend(form, v, n).value));
  }
  // Labels stand on the falling diagonal, where the curves are furthest apart.
  double low = 0.0, high = 1.0;
  for (int i = 0; i < 40; ++i) {
    const double v = 0.5 * (low + high);
    (blend(form, v, n).value < 1.0 - v ? low : high) = v;
  }
  const int hue = count > 1 ? 220 - 220 * index / (count - 1) : 220;
  return fmt::format(
      "<polyline points='{}' fill='none' stroke='hsl({},65%,42%)' stroke-width='1.8'/>"
      "<text x='{:.1f}' y='{:.1f}' class='label'>{:g}</text>\n",
      points, hue, x_px(low), y_px(1.0 - low) + 4, n);
}

void run_blends(const BlendsOptions& options) {
  const BlendForm form = options.form == "flat" ? BlendForm::flat : BlendForm::rational;
  const int count = static_cast<int>(options.n.size());
  std::string curves;
  for (int i = 0; i < count; ++i) curves += curve(form, options.n[i], i, count);
  const double size = side_px + 2.0 * margin_px;
  AtomicFile file(options.picture);
  file.stream() << fmt::format(
      "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {0} {0}' width='{0}' height='{0}' "
      "font-family='sans-serif' font-size='12' fill='#333'>\n"
      "<style>.label{{paint-order:stroke;stroke:#fff;stroke-width:4px;text-anchor:middle}}</"
      "style>\n"
      "<rect width='100%' height='100%' fill='#fff'/>\n{1}{2}"
      "<text x='{3}' y='{4}' text-anchor='middle'>v</text>"
      "<text x='14' y='{5}' text-anchor='middle'>R</text>"
      "<text x='{3}' y='26' text-anchor='middle' font-size='14'>{6} blend, by n</text>\n</svg>\n",
      size, grid(), curves, x_px(0.5), size - 8, y_px(0.5), options.form);
  file.commit();
}

}  // namespace

void add_sweep_blends_command(CLI::App& sweep, Context& context) {
  auto options = std::make_shared<BlendsOptions>();
  CLI::App* blends =
      sweep.add_subcommand("blends", "Draw the blending functions for some n, to choose one");
  blends->add_option("-o,--output", options->picture, "SVG to write")->required();
  blends->add_option("--form", options->form, "flat or rational")
      ->check(CLI::IsMember({"flat", "rational"}))
      ->capture_default_str();
  blends->add_option("--n", options->n, "Blending parameters, above -1")->capture_default_str();
  blends->callback([&context, options] { context.action = [options] { run_blends(*options); }; });
}

}  // namespace semblance::cli
