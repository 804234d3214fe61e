#include "semblance/cameras/print_sheet.h"

#include <cairo/cairo-pdf.h>
#include <cairo/cairo-svg.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "charuco_layout.h"
#include "dictionaries.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "tag_family.h"

namespace semblance {

namespace {

using Eigen::Vector2d;

constexpr double kPointsPerMetre = 72.0 / 0.0254;
constexpr double kPaperMargin = 0.005;  // m; most printers cannot reach the edge
constexpr double kFooter = 0.016;       // m, for ruler and text
constexpr double kRuler = 0.1;

struct Paper {
  const char* name;
  double width_m, height_m;
};
constexpr std::array<Paper, 9> kPapers = {{{"a5", 0.148, 0.210},
                                           {"a4", 0.210, 0.297},
                                           {"a3", 0.297, 0.420},
                                           {"a2", 0.420, 0.594},
                                           {"a1", 0.594, 0.841},
                                           {"a0", 0.841, 1.189},
                                           {"letter", 0.2159, 0.2794},
                                           {"legal", 0.2159, 0.3556},
                                           {"tabloid", 0.2794, 0.4318}}};

void add_square(SheetShapes& shapes, const Vector2d& corner, double side) {
  shapes.rectangles.push_back({corner, corner + Vector2d(side, side)});
}

/// Runs of black cells of a small picture whose upper left is at `corner`.
template <typename IsBlack>
void add_cells(SheetShapes& shapes, const Vector2d& corner, double cell_m, int count,
               const IsBlack& is_black) {
  for (int y = 0; y < count; ++y) {
    for (int x = 0; x < count;) {
      int end = x;
      while (end < count && is_black(end, y)) ++end;
      if (end > x) {
        shapes.rectangles.push_back(
            {corner + cell_m * Vector2d(x, y), corner + cell_m * Vector2d(end, y + 1)});
      }
      x = end + 1;
    }
  }
}

void draw_chessboard(const Target& target, SheetShapes& shapes) {
  const double s = target.size_m;
  for (int row = -1; row < target.rows; ++row) {
    for (int column = -1; column < target.columns; ++column) {
      if ((column + row) % 2 == 0) add_square(shapes, s * Vector2d(column, row), s);
    }
  }
}

void draw_charuco(const Target& target, SheetShapes& shapes) {
  const double s = target.size_m;
  const int shift = target.legacy ? (target.rows - 1) % 2 : 0;
  for (int row = 0; row < target.rows; ++row) {
    for (int column = 0; column < target.columns; ++column) {
      if ((column + row + shift) % 2 == 0) add_square(shapes, s * Vector2d(column, row), s);
    }
  }
  const auto dictionary = dictionary_of(target.dictionary);
  const int cells = dictionary->markerSize + 2;
  const std::vector<Eigen::Vector2i> places = charuco_cells(target);
  for (std::size_t id = 0; id < places.size(); ++id) {
    cv::Mat marker;
    dictionary->drawMarker(static_cast<int>(id), cells, marker, 1);
    const double margin = 0.5 * (s - target.marker_m);
    add_cells(shapes, s * places[id].cast<double>() + Vector2d(margin, margin),
              target.marker_m / cells, cells,
              [&](int x, int y) { return marker.at<std::uint8_t>(y, x) < 128; });
  }
}

void draw_aprilgrid(const Target& target, SheetShapes& shapes) {
  const TagFamily family = make_tag_family(target.border_bits);
  const int cells = family->width_at_border;
  for (int tag = 0; tag < target.columns * target.rows; ++tag) {
    const int id = target.first_id + tag;
    const Vector2d corner = point_on_sheet(target, 4 * id + 3).head<2>();
    std::vector<bool> white(static_cast<std::size_t>(cells) * cells, false);
    for (std::uint32_t bit = 0; bit < family->nbits; ++bit) {  // the first is the highest
      const bool set = (family->codes[id] >> (family->nbits - 1 - bit)) & 1;
      white[family->bit_y[bit] * cells + family->bit_x[bit]] = set;
    }
    add_cells(shapes, corner, target.size_m / cells, cells,
              [&](int x, int y) { return !white[y * cells + x]; });
  }
  const double gap = target.gap_ratio * target.size_m;
  for (int row = 0; row <= target.rows; ++row) {
    for (int column = 0; column <= target.columns; ++column) {
      add_square(shapes, (target.size_m + gap) * Vector2d(column, row) - Vector2d(gap, gap), gap);
    }
  }
}

void draw_dots(const Target& target, SheetShapes& shapes) {
  std::vector<int> large;
  if (target.kind == TargetKind::dots) {
    for (const Eigen::Vector2i& p : large_dots(target)) {
      large.push_back(p.x() + target.columns * p.y());
    }
  }
  for (const int id : point_ids(target)) {
    const bool is_large = std::find(large.begin(), large.end(), id) != large.end();
    shapes.discs.push_back({point_on_sheet(target, id).head<2>(),
                            0.5 * target.size_m * (is_large ? large_dot_steps : small_dot_steps)});
  }
}

/// White around the shapes that the detectors need.
double quiet_zone(const Target& target) {
  switch (target.kind) {
    case TargetKind::aprilgrid:
      return 0.5 * target.gap_ratio * target.size_m;
    case TargetKind::chessboard:
    case TargetKind::charuco:
      return 0.25 * target.size_m;
    default:
      return 0.5 * target.size_m;
  }
}

bool fits(const Vector2d& needed_m, double width_m, double height_m) {
  return needed_m.x() <= width_m + 1e-9 && needed_m.y() <= height_m + 1e-9;
}

/// The paper's size, turned so that the sheet fits; none where it does not.
std::optional<Vector2d> fitting(const Paper& paper, const Vector2d& needed_m) {
  if (fits(needed_m, paper.width_m, paper.height_m)) return Vector2d(paper.width_m, paper.height_m);
  if (fits(needed_m, paper.height_m, paper.width_m)) return Vector2d(paper.height_m, paper.width_m);
  return std::nullopt;
}

Vector2d paper_size(const std::string& name, const Vector2d& needed_m, const Target& target) {
  const auto paper =
      std::find_if(kPapers.begin(), kPapers.end(), [&](const Paper& p) { return name == p.name; });
  if (paper == kPapers.end()) {
    throw InvalidInput(
        fmt::format("paper '{}': not one of {}", name, fmt::join(paper_names(), ", ")));
  }
  if (const auto size = fitting(*paper, needed_m)) return *size;
  const auto larger = std::find_if(kPapers.begin(), kPapers.end(), [&](const Paper& p) {
    return fitting(p, needed_m).has_value();
  });
  throw InvalidInput(fmt::format(
      "{} needs {:.0f} x {:.0f} mm with ruler and margins, {} has {:.0f} x {:.0f} mm: {}",
      target_text(target), 1e3 * needed_m.x(), 1e3 * needed_m.y(), name, 1e3 * paper->width_m,
      1e3 * paper->height_m,
      larger == kPapers.end() ? std::string("give a smaller size")
                              : fmt::format("give a smaller size, or --paper {}", larger->name)));
}

/// A page of cairo's in metres. The file appears when it is finished.
class Page {
 public:
  Page(const std::string& path, const Vector2d& size_m) : file_(path) {
    const std::string temporary = file_.temporary_path().string();
    const Vector2d size_pt = kPointsPerMetre * size_m;
    const std::string extension = file_.path().extension().string();
    if (extension == ".pdf") {
      surface_.reset(cairo_pdf_surface_create(temporary.c_str(), size_pt.x(), size_pt.y()));
      // No date: the same sheet makes the same bytes.
      cairo_pdf_surface_set_metadata(surface_.get(), CAIRO_PDF_METADATA_CREATE_DATE,
                                     "2000-01-01T00:00:00Z");
    } else if (extension == ".svg") {
      surface_.reset(cairo_svg_surface_create(temporary.c_str(), size_pt.x(), size_pt.y()));
      cairo_svg_surface_set_document_unit(surface_.get(), CAIRO_SVG_UNIT_PT);
    } else {
      throw InvalidInput(path + ": sheets are written as .pdf or .svg");
    }
    context_.reset(cairo_create(surface_.get()));
    cairo_scale(context_.get(), kPointsPerMetre, kPointsPerMetre);
  }

  cairo_t* context() { return context_.get(); }

  void finish() {
    const cairo_status_t drawn = cairo_status(context_.get());
    context_.reset();
    cairo_surface_finish(surface_.get());
    const cairo_status_t written = cairo_surface_status(surface_.get());
    for (const cairo_status_t status : {drawn, written}) {
      if (status != CAIRO_STATUS_SUCCESS) {
        throw IoError(fmt::format("{}: cannot be written ({})", file_.path().string(),
                                  cairo_status_to_string(status)));
      }
    }
    file_.commit();
  }

 private:
  struct Deleter {
    void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
    void operator()(cairo_t* context) const { cairo_destroy(context); }
  };

  AtomicFile file_;
  std::unique_ptr<cairo_surface_t, Deleter> surface_;
  std::unique_ptr<cairo_t, Deleter> context_;
};

/// All shapes in one path: filled one by one, neighbours would show a seam.
void fill_shapes(cairo_t* page, const SheetShapes& shapes) {
  for (const BlackRectangle& r : shapes.rectangles) {
    const Vector2d size = r.upper_m - r.lower_m;
    cairo_rectangle(page, r.lower_m.x(), r.lower_m.y(), size.x(), size.y());
  }
  for (const BlackDisc& d : shapes.discs) {
    cairo_new_sub_path(page);
    cairo_arc(page, d.centre_m.x(), d.centre_m.y(), d.radius_m, 0.0, 2.0 * std::numbers::pi);
  }
  cairo_fill(page);
}

/// A ruler of whole centimetres whose upper left is at `corner`, and text beside its numbers.
void draw_footer(cairo_t* page, const Vector2d& corner, double width_m, const std::string& text) {
  const int millimetres = std::min(100, static_cast<int>(width_m * 100.0) * 10);
  const double length = 1e-3 * millimetres;
  cairo_set_line_width(page, 0.0002);
  cairo_move_to(page, corner.x(), corner.y());
  cairo_line_to(page, corner.x() + length, corner.y());
  for (int mm = 0; mm <= millimetres; ++mm) {
    const double height = mm % 10 == 0 ? 0.004 : (mm % 5 == 0 ? 0.003 : 0.002);
    cairo_move_to(page, corner.x() + 1e-3 * mm, corner.y());
    cairo_line_to(page, corner.x() + 1e-3 * mm, corner.y() + height);
  }
  cairo_stroke(page);
  cairo_select_font_face(page, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(page, 0.0028);
  const std::string line =
      fmt::format("{} mm: measure it, and print at 100 % scale    --target {}", millimetres, text);
  cairo_text_extents_t extents;
  cairo_text_extents(page, line.c_str(), &extents);
  if (extents.width > width_m) cairo_set_font_size(page, 0.0028 * width_m / extents.width);
  cairo_move_to(page, corner.x(), corner.y() + 0.0085);
  cairo_show_text(page, line.c_str());
}

}  // namespace

BlackRectangle SheetShapes::bounds() const {
  BlackRectangle box{Vector2d::Constant(1e300), Vector2d::Constant(-1e300)};
  for (const BlackRectangle& r : rectangles) {
    box.lower_m = box.lower_m.cwiseMin(r.lower_m);
    box.upper_m = box.upper_m.cwiseMax(r.upper_m);
  }
  for (const BlackDisc& d : discs) {
    box.lower_m = box.lower_m.cwiseMin(d.centre_m - Vector2d::Constant(d.radius_m));
    box.upper_m = box.upper_m.cwiseMax(d.centre_m + Vector2d::Constant(d.radius_m));
  }
  return box;
}

SheetShapes sheet_shapes(const Target& target) {
  SheetShapes shapes;
  switch (target.kind) {
    case TargetKind::automatic:
      throw InvalidInput("target 'auto' names no sheet: say which, as in chessboard:9x6:0.025");
    case TargetKind::chessboard:
      draw_chessboard(target, shapes);
      break;
    case TargetKind::charuco:
      draw_charuco(target, shapes);
      break;
    case TargetKind::aprilgrid:
      draw_aprilgrid(target, shapes);
      break;
    case TargetKind::circles:
    case TargetKind::dots:
      draw_dots(target, shapes);
      break;
  }
  return shapes;
}

std::vector<std::string> paper_names() {
  std::vector<std::string> names;
  for (const Paper& p : kPapers) names.emplace_back(p.name);
  return names;
}

void print_sheet(const Target& target, const std::string& paper, const std::string& path) {
  const SheetShapes shapes = sheet_shapes(target);
  const BlackRectangle box = shapes.bounds();
  const Vector2d extent = box.upper_m - box.lower_m;
  const double around = 2.0 * std::max(kPaperMargin, quiet_zone(target));
  const Vector2d needed = extent + Vector2d(around, around + kFooter);
  const Vector2d size = paper_size(paper, needed, target);
  Page page(path, size);
  cairo_set_source_rgb(page.context(), 1.0, 1.0, 1.0);
  cairo_paint(page.context());
  cairo_set_source_rgb(page.context(), 0.0, 0.0, 0.0);
  const Vector2d corner = 0.5 * (size - Vector2d(0.0, kFooter) - extent);
  cairo_save(page.context());
  cairo_translate(page.context(), corner.x() - box.lower_m.x(), corner.y() - box.lower_m.y());
  fill_shapes(page.context(), shapes);
  cairo_restore(page.context());
  const double left = std::max(2.0 * kPaperMargin, std::min(corner.x(), 0.5 * (size.x() - kRuler)));
  draw_footer(page.context(), {left, size.y() - kFooter + 0.002}, size.x() - 2.0 * left,
              target_text(target));
  page.finish();
}

}  // namespace semblance
