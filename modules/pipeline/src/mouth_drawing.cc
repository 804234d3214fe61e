#include "mouth_drawing.h"

#include <fmt/format.h>

#include <cmath>

#include "semblance/core/atomic_file.h"

namespace semblance {
namespace {

using Eigen::Vector2d;

constexpr double width = 720.0, height = 520.0, margin = 90.0;

/// A drawing in picture coordinates, scaled to fit.
class Drawing {
 public:
  Drawing(const Vector2d& low_px, const Vector2d& high_px) {
    const Vector2d size = (high_px - low_px).cwiseMax(1e-9);
    scale_ = std::min((width - 2 * margin) / size.x(), (height - 2 * margin) / size.y());
    shift_ = 0.5 * Vector2d(width, height) - scale_ * 0.5 * (low_px + high_px);
  }

  void polyline(const std::vector<Vector2d>& points, const char* style, bool closed = false) {
    std::string list;
    for (const Vector2d& p : points) {
      const Vector2d q = place(p);
      list += fmt::format("{:.1f},{:.1f} ", q.x(), q.y());
    }
    out_ += fmt::format("<{} points='{}' fill='none' {}/>\n", closed ? "polygon" : "polyline", list,
                        style);
  }
  void dot(const Vector2d& p, double radius, const char* colour) {
    const Vector2d q = place(p);
    out_ += fmt::format("<circle cx='{:.1f}' cy='{:.1f}' r='{}' fill='{}'/>\n", q.x(), q.y(),
                        radius, colour);
  }
  void arrow(const Vector2d& from, const Vector2d& to, const char* colour) {
    polyline({from, to},
             fmt::format("stroke='{}' stroke-width='1.5' marker-end='url(#tip)'", colour).c_str());
  }
  void label(const Vector2d& p, const Vector2d& offset_px, const std::string& text) {
    const Vector2d q = place(p) + offset_px;
    out_ += fmt::format("<text x='{:.1f}' y='{:.1f}'>{}</text>\n", q.x(), q.y(), text);
  }
  double px_from_drawing(double length) const { return length / scale_; }

  void write(const std::string& path, const std::string& title) const {
    AtomicFile file(path);
    file.stream() << fmt::format(
        "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {0} {1}' width='{0}' height='{1}' "
        "font-family='sans-serif' font-size='15' fill='#222'>\n<defs><marker id='tip' "
        "viewBox='0 0 8 8' refX='7' refY='4' markerWidth='7' markerHeight='7' orient='auto'>"
        "<path d='M0 0L8 4L0 8z' fill='context-stroke'/></marker></defs>\n"
        "<rect width='100%' height='100%' fill='#fff'/>\n{2}"
        "<text x='{3}' y='28' text-anchor='middle'>{4}</text>\n</svg>\n",
        width, height, out_, 0.5 * width, title);
    file.commit();
  }

 private:
  Vector2d place(const Vector2d& p) const { return scale_ * p + shift_; }

  double scale_ = 1.0;
  Vector2d shift_;
  std::string out_;
};

constexpr const char* first_colour = "#1f5fb4";
constexpr const char* second_colour = "#c0392b";

void include(const Vector2d& p, Vector2d& low, Vector2d& high) {
  low = low.cwiseMin(p);
  high = high.cwiseMax(p);
}

void draw_contours(Drawing& drawing, const MouthKey& key, const char* colour) {
  for (std::size_t first = 0; first < key.position_px.size(); first += 8) {
    const std::vector<Vector2d> ring(
        key.position_px.begin() + static_cast<std::ptrdiff_t>(first),
        key.position_px.begin() + static_cast<std::ptrdiff_t>(first + 8));
    drawing.polyline(
        ring, fmt::format("stroke='{}' stroke-width='1' opacity='0.55'", colour).c_str(), true);
  }
  for (const Vector2d& p : key.position_px) drawing.dot(p, 4.0, colour);
}

std::vector<Vector2d> sampled_path(const MouthMotion& motion, int marker, double start_s,
                                   double end_s) {
  constexpr int steps = 40;
  std::vector<Vector2d> points;
  MouthPoints at;
  for (int i = 0; i <= steps; ++i) {
    motion.at(start_s + (end_s - start_s) * i / steps, at);
    points.push_back(at.row(marker).head<2>());
  }
  return points;
}

struct Longest {
  std::size_t segment = 0, marker = 0;
};
Longest longest_way(const std::vector<MouthKey>& keys) {
  Longest best;
  double longest = -1.0, longest_sum = -1.0;
  for (std::size_t s = 0; s + 1 < keys.size(); ++s) {
    double sum = 0.0;
    for (std::size_t i = 0; i < keys[s].position_px.size(); ++i) {
      sum += (keys[s + 1].position_px[i] - keys[s].position_px[i]).norm();
    }
    if (sum > longest_sum) {
      longest_sum = sum;
      best.segment = s;
    }
  }
  const MouthKey &a = keys[best.segment], &b = keys[best.segment + 1];
  for (std::size_t i = 0; i < a.position_px.size(); ++i) {
    const double way = (b.position_px[i] - a.position_px[i]).norm();
    if (way > longest) {
      longest = way;
      best.marker = i;
    }
  }
  return best;
}

}  // namespace

void write_paths_svg(const std::string& path, const std::vector<MouthKey>& keys,
                     const MouthMotion& motion, const std::optional<Vector2d>& reference_px) {
  const Longest longest = longest_way(keys);
  const MouthKey &a = keys[longest.segment], &b = keys[longest.segment + 1];
  const Vector2d origin = reference_px.value_or(mouth_reference(a.position_px));
  Vector2d low = origin, high = origin;
  for (const MouthKey* key : {&a, &b}) {
    for (const Vector2d& p : key->position_px) include(p, low, high);
  }
  Drawing drawing(low, high);
  draw_contours(drawing, a, first_colour);
  draw_contours(drawing, b, second_colour);
  // Velocities as far as they go in an eighth of the segment.
  const double part_s = (b.time_s - a.time_s) / 8.0;
  for (std::size_t i = 0; i < a.position_px.size(); ++i) {
    drawing.polyline(sampled_path(motion, static_cast<int>(i), a.time_s, b.time_s),
                     "stroke='#777' stroke-width='1.5'");
    drawing.arrow(a.position_px[i], a.position_px[i] + part_s * a.velocity_px_s[i], first_colour);
    drawing.arrow(b.position_px[i], b.position_px[i] + part_s * b.velocity_px_s[i], second_colour);
  }

  const Vector2d start = a.position_px[longest.marker], end = b.position_px[longest.marker];
  const Vector2d radial = (start - origin).normalized(), tangential(-radial.y(), radial.x());
  MouthPoints halfway;
  motion.at(0.5 * (a.time_s + b.time_s), halfway);
  const Vector2d middle = halfway.row(static_cast<Eigen::Index>(longest.marker)).head<2>();
  const Vector2d foot = origin + radial * radial.dot(middle - origin);
  drawing.polyline({origin, foot, middle}, "stroke='#222' stroke-dasharray='5 4'");
  const double axis_px = drawing.px_from_drawing(60.0);
  drawing.arrow(origin, origin + axis_px * radial, "#222");
  drawing.arrow(origin, origin + axis_px * tangential, "#222");
  drawing.dot(origin, 3.0, "#222");
  drawing.dot(middle, 4.0, "#222");
  drawing.label(origin, {-20, 5}, "O");
  drawing.label(start, {8, -8}, "A");
  drawing.label(end, {8, 18}, "B");
  drawing.label(middle, {9, 5}, "M");
  drawing.label(origin + axis_px * radial, {7, -2}, "u<tspan dy='4' font-size='11'>r</tspan>");
  drawing.label(origin + axis_px * tangential, {7, -2},
                "u<tspan dy='4' font-size='11'>&#952;</tspan>");
  drawing.write(path, fmt::format("frames {} (blue) to {} (red)", a.frame, b.frame));
}

void write_wireframe_svg(const std::string& path, const MouthWireframe& wireframe,
                         const MouthMotion& motion) {
  MouthPoints markers, points;
  motion.at(motion.start_s(), markers);
  wireframe.evaluate(markers, points);
  Drawing drawing(points.leftCols<2>().colwise().minCoeff(),
                  points.leftCols<2>().colwise().maxCoeff());
  const int ring = wireframe.ring_size(), between = ring / 8;
  const auto point = [&](int contour, int k) -> Vector2d {
    return points.row(contour * ring + k % ring).head<2>();
  };
  for (int k = 0; k < ring; ++k) {
    std::vector<Vector2d> fibre;
    for (int c = 0; c < MouthWireframe::contour_count; ++c) fibre.push_back(point(c, k));
    drawing.polyline(fibre, "stroke='#bbb' stroke-width='0.8'");
  }
  for (int c = 0; c < MouthWireframe::contour_count; ++c) {
    std::vector<Vector2d> contour;
    for (int k = 0; k < ring; ++k) contour.push_back(point(c, k));
    drawing.polyline(contour, "stroke='#333' stroke-width='1.2'", true);
    const bool marked = c == 0 || c + 1 == MouthWireframe::contour_count;
    for (int k = 0; k < ring; ++k) {
      const bool marker = k % between == 0;
      drawing.dot(point(c, k),
                  marker && marked ? 6.0
                  : marker         ? 4.0
                                   : 2.0,
                  marked && marker ? second_colour : "#333");
    }
  }
  drawing.write(path, "contours C0 (outer) to C3 (inner); red: markers");
}

}  // namespace semblance
