#include "drawn_photos.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "semblance/core/html_page.h"
#include "semblance/io/image_io.h"

namespace semblance::cli {

std::string svg_over(const Rgb8& photo) {
  return fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"100%\">\n"
      "<image width=\"{0}\" height=\"{1}\" href=\"data:image/jpeg;base64,{2}\"/>\n",
      photo.width, photo.height, base64(encode_image(photo, ImageFormat::jpeg)));
}

std::string svg_name(const Eigen::Vector2d& at_px, double font_px, const char* colour,
                     const std::string& name) {
  constexpr double rim = 0.2;
  return fmt::format(
      "<text x=\"{:.1f}\" y=\"{:.1f}\" font-size=\"{:.1f}\" font-family=\"sans-serif\" "
      "fill=\"{}\" stroke=\"#000\" stroke-width=\"{:.2f}\" paint-order=\"stroke\">{}</text>\n",
      at_px.x(), at_px.y() + 0.35 * font_px, font_px, colour, rim * font_px, escape_html(name));
}

ReportPicture draw_marks(const std::string& file, const std::vector<DrawnMark>& marks) {
  constexpr double magnified = 10.0;
  const Rgb8 photo = read_image_rgb8(file);
  const double line = std::max(photo.width, photo.height) / 900.0, ring = 5.0 * line;
  std::string svg = svg_over(photo);
  for (const DrawnMark& mark : marks) {
    const char* colour = mark.outlier ? "#ff3b45" : "#19c37d";
    const Eigen::Vector2d &at = mark.mark_px, to = at + magnified * (mark.seen_px - at);
    svg += fmt::format(
        "<g stroke=\"{0}\" fill=\"none\" stroke-width=\"{1:.2f}\">"
        "<circle cx=\"{2:.1f}\" cy=\"{3:.1f}\" r=\"{4:.1f}\"/>",
        colour, line, at.x(), at.y(), ring);
    if (to.allFinite()) {
      svg +=
          fmt::format("<path d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\"/>", at.x(), at.y(), to.x(), to.y());
    }
    svg +=
        "</g>\n" + svg_name(at + Eigen::Vector2d(1.4 * ring, 0.0), 14.0 * line, colour, mark.name);
  }
  return {std::filesystem::path(file).filename().string() +
              ": marks, and lines to where their points are seen, 10 times as long",
          svg + "</svg>\n"};
}

}  // namespace semblance::cli
