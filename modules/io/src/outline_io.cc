#include "semblance/io/outline_io.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <optional>
#include <pugixml.hpp>
#include <vector>

#include "parsers.h"
#include "semblance/core/errors.h"
#include "semblance/io/text.h"

namespace semblance {
namespace {

using Eigen::Matrix2Xd;
using Eigen::Vector2d;
using Points = std::vector<Vector2d>;

constexpr std::size_t most_points = 65536;
constexpr int parts_of_a_curve = 32;

void add(Points& points, const Vector2d& p, const std::string& source) {
  if (!p.allFinite()) throw InvalidInput(source + ": a coordinate is not finite");
  if (points.size() == most_points) {
    throw InvalidInput(fmt::format("{}: more than {} points", source, most_points));
  }
  points.push_back(p);
}

Matrix2Xd closed(Points points, const std::string& source) {
  while (points.size() > 1 && points.back() == points.front()) points.pop_back();
  if (points.empty()) {
    throw InvalidInput(source + ": the contour is empty; two numbers a line, or a shape, expected");
  }
  Matrix2Xd result(2, static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) {
    result.col(static_cast<Eigen::Index>(i)) = points[i];
  }
  return result;
}

/// Numbers and letters of SVG's compact notation: "M10-5.5.5,3e2z".
class SvgScanner {
 public:
  SvgScanner(std::string_view text, const std::string& source) : rest_(text), source_(source) {}

  bool at_end() {
    skip();
    return rest_.empty();
  }
  bool at_number() {
    skip();
    return !rest_.empty() && (std::isdigit(static_cast<unsigned char>(rest_[0])) ||
                              rest_[0] == '-' || rest_[0] == '+' || rest_[0] == '.');
  }
  char letter() {
    skip();
    const char c = rest_.empty() ? '\0' : rest_[0];
    if (!rest_.empty()) rest_.remove_prefix(1);
    return c;
  }
  double number() {
    if (!at_number()) fail("a number");
    std::size_t end = 0, digits = 0;
    bool point = false;
    if (rest_[0] == '-' || rest_[0] == '+') end = 1;
    for (; end < rest_.size(); ++end) {
      const char c = rest_[end];
      if (c == '.' && !point) {
        point = true;
      } else if (std::isdigit(static_cast<unsigned char>(c))) {
        ++digits;
      } else {
        break;
      }
    }
    end = with_exponent(end);
    std::string_view word = rest_.substr(0, end);
    if (word[0] == '+') word.remove_prefix(1);
    double value = 0.0;
    if (digits == 0 || !text::parse(word, value)) fail("a number");
    rest_.remove_prefix(end);
    return value;
  }
  bool flag() {
    skip();
    const char c = rest_.empty() ? '\0' : rest_[0];
    if (c != '0' && c != '1') fail("0 or 1");
    rest_.remove_prefix(1);
    return c == '1';
  }
  Vector2d point() {
    const double x = number();
    return {x, number()};
  }
  /// A word of letters, as the names of transforms.
  std::string word() {
    skip();
    std::string name;
    while (!rest_.empty() && std::isalpha(static_cast<unsigned char>(rest_[0]))) {
      name += rest_[0];
      rest_.remove_prefix(1);
    }
    return name;
  }
  [[noreturn]] void fail(const std::string& expected) const {
    throw InvalidInput(fmt::format("{}: {} expected before {}", source_, expected,
                                   rest_.empty() ? "the end" : text::quoted(rest_.substr(0, 20))));
  }

 private:
  void skip() {
    while (!rest_.empty() &&
           std::string_view(" \t\r\n,").find(rest_[0]) != std::string_view::npos) {
      rest_.remove_prefix(1);
    }
  }
  std::size_t with_exponent(std::size_t end) const {
    if (end >= rest_.size() || (rest_[end] != 'e' && rest_[end] != 'E')) return end;
    std::size_t after = end + 1;
    if (after < rest_.size() && (rest_[after] == '-' || rest_[after] == '+')) ++after;
    const std::size_t first = after;
    while (after < rest_.size() && std::isdigit(static_cast<unsigned char>(rest_[after]))) ++after;
    return after > first ? after : end;
  }

  std::string_view rest_;
  const std::string& source_;
};

/// Follows the path data of SVG 1.1, section 8.3, with one closed subpath.
class SvgPath {
 public:
  SvgPath(std::string_view data, const std::string& source)
      : scan_(data, source), source_(source) {}

  Points flatten() {
    char command = scan_.letter();
    if (command != 'M' && command != 'm') scan_.fail("a path that begins with M");
    while (command != '\0') {
      if (command == 'Z' || command == 'z') {
        if (!scan_.at_end()) {
          throw InvalidInput(source_ +
                             ": the path has several parts; a contour is one closed curve, leave "
                             "one part");
        }
        break;
      }
      step(command);
      if (scan_.at_end()) break;
      if (scan_.at_number()) {
        if (command == 'M') command = 'L';
        if (command == 'm') command = 'l';
      } else {
        command = scan_.letter();
      }
    }
    return std::move(points_);
  }

 private:
  Vector2d target(bool relative) {
    const Vector2d p = scan_.point();
    return relative ? Vector2d(here_ + p) : p;
  }
  void line_to(const Vector2d& p) {
    add(points_, p, source_);
    here_ = p;
  }
  void cubic_to(const Vector2d& c1, const Vector2d& c2, const Vector2d& end) {
    const Vector2d start = here_;
    for (int i = 1; i <= parts_of_a_curve; ++i) {
      const double t = double(i) / parts_of_a_curve, s = 1.0 - t;
      line_to(s * s * s * start + 3 * s * s * t * c1 + 3 * s * t * t * c2 + t * t * t * end);
    }
    handle_ = c2;
  }
  void quadratic_to(const Vector2d& c, const Vector2d& end) {
    cubic_to(here_ + 2.0 / 3.0 * (c - here_), end + 2.0 / 3.0 * (c - end), end);
    handle_ = c;
  }
  void arc_to(bool relative);

  void step(char command) {
    const bool relative = std::islower(static_cast<unsigned char>(command)) != 0;
    const char kind = static_cast<char>(std::toupper(static_cast<unsigned char>(command)));
    // A smooth curve goes on from the handle of a curve of its own kind, else from the point.
    const bool same = (kind == 'S' && (last_ == 'C' || last_ == 'S')) ||
                      (kind == 'T' && (last_ == 'Q' || last_ == 'T'));
    const Vector2d mirrored = same ? Vector2d(2.0 * here_ - handle_) : here_;
    switch (kind) {
      case 'M':
        if (!points_.empty()) {
          throw InvalidInput(source_ +
                             ": the path has several parts; a contour is one closed curve, leave "
                             "one part");
        }
        line_to(target(relative));
        break;
      case 'L':
        line_to(target(relative));
        break;
      case 'H':
        line_to({scan_.number() + (relative ? here_.x() : 0.0), here_.y()});
        break;
      case 'V':
        line_to({here_.x(), scan_.number() + (relative ? here_.y() : 0.0)});
        break;
      case 'C': {
        const Vector2d c1 = target(relative), c2 = target(relative);
        cubic_to(c1, c2, target(relative));
        break;
      }
      case 'S': {
        const Vector2d c2 = target(relative);
        cubic_to(mirrored, c2, target(relative));
        break;
      }
      case 'Q': {
        const Vector2d c = target(relative);
        quadratic_to(c, target(relative));
        break;
      }
      case 'T':
        quadratic_to(mirrored, target(relative));
        break;
      case 'A':
        arc_to(relative);
        break;
      default:
        scan_.fail("a path command (M L H V C S Q T A Z)");
    }
    last_ = kind;
  }

  SvgScanner scan_;
  const std::string& source_;
  Points points_;
  Vector2d here_ = Vector2d::Zero(), handle_ = Vector2d::Zero();
  char last_ = '\0';
};

// From end points to centre: SVG 1.1, appendix F.6.5.
void SvgPath::arc_to(bool relative) {
  Vector2d radii = scan_.point().cwiseAbs();
  const double turn = scan_.number() * std::numbers::pi / 180.0;
  const bool large = scan_.flag(), sweep = scan_.flag();
  const Vector2d start = here_, end = target(relative);
  if (start == end) return;
  if (radii.minCoeff() == 0.0) return line_to(end);
  const Eigen::Matrix2d rotation = Eigen::Rotation2Dd(turn).toRotationMatrix();
  const Vector2d half = rotation.transpose() * (start - end) * 0.5;
  const double reach = half.cwiseQuotient(radii).squaredNorm();
  if (reach > 1.0) radii *= std::sqrt(reach);  // too small: scaled up until they fit
  const double rest = std::sqrt(std::max(0.0, 1.0 / half.cwiseQuotient(radii).squaredNorm() - 1.0));
  const Vector2d centre =
      (large == sweep ? -1.0 : 1.0) * rest *
      Vector2d(radii.x() * half.y() / radii.y(), -radii.y() * half.x() / radii.x());
  const auto angle = [&](const Vector2d& p) {
    const Vector2d q = p.cwiseQuotient(radii);
    return std::atan2(q.y(), q.x());
  };
  const double first = angle(half - centre);
  double way = angle(-half - centre) - first;
  if (sweep && way < 0.0) way += 2.0 * std::numbers::pi;
  if (!sweep && way > 0.0) way -= 2.0 * std::numbers::pi;
  const Vector2d middle = rotation * centre + 0.5 * (start + end);
  for (int i = 1; i < parts_of_a_curve; ++i) {
    const double a = first + way * i / parts_of_a_curve;
    line_to(middle + rotation * radii.cwiseProduct(Vector2d(std::cos(a), std::sin(a))));
  }
  line_to(end);
}

Eigen::Affine2d parse_transform(std::string_view text, const std::string& source) {
  SvgScanner scan(text, source);
  Eigen::Affine2d total = Eigen::Affine2d::Identity();
  while (!scan.at_end()) {
    const std::string name = scan.word();
    std::vector<double> a;
    if (scan.letter() != '(') scan.fail("'('");
    while (scan.at_number() && a.size() < 6) a.push_back(scan.number());
    if (scan.letter() != ')') scan.fail("')'");
    const double degree = std::numbers::pi / 180.0;
    Eigen::Affine2d t = Eigen::Affine2d::Identity();
    if (name == "matrix" && a.size() == 6) {
      t.matrix().topRows<2>() << a[0], a[2], a[4], a[1], a[3], a[5];
    } else if (name == "translate" && (a.size() == 1 || a.size() == 2)) {
      t.translate(Vector2d(a[0], a.size() == 2 ? a[1] : 0.0));
    } else if (name == "scale" && (a.size() == 1 || a.size() == 2)) {
      t.scale(Vector2d(a[0], a.back()));
    } else if (name == "rotate" && (a.size() == 1 || a.size() == 3)) {
      const Vector2d about = a.size() == 3 ? Vector2d(a[1], a[2]) : Vector2d(0, 0);
      t.translate(about).rotate(a[0] * degree).translate(Vector2d(-about));
    } else if (name == "skewX" && a.size() == 1) {
      t.matrix()(0, 1) = std::tan(a[0] * degree);
    } else if (name == "skewY" && a.size() == 1) {
      t.matrix()(1, 0) = std::tan(a[0] * degree);
    } else {
      throw InvalidInput(
          fmt::format("{}: transform {} is not understood", source, text::quoted(name)));
    }
    total = total * t;
  }
  return total;
}

double length_of(const pugi::xml_node& node, const char* name, const std::string& source) {
  const char* text = node.attribute(name).as_string("0");
  SvgScanner scan(text, source);
  const double value = scan.number();
  if (!scan.at_end() && (scan.word() != "px" || !scan.at_end())) {
    throw InvalidInput(fmt::format("{}: {} is {}; a number without unit (or px) was expected",
                                   source, name, text::quoted(text)));
  }
  return value;
}

Points ellipse_points(const Vector2d& centre, const Vector2d& radii) {
  Points points;
  for (int i = 0; i < 4 * parts_of_a_curve; ++i) {
    const double a = 2.0 * std::numbers::pi * i / (4 * parts_of_a_curve);
    points.push_back(centre + radii.cwiseProduct(Vector2d(std::cos(a), std::sin(a))));
  }
  return points;
}

// The points of a shape, or nothing if the element is not one.
std::optional<Points> shape_points(const pugi::xml_node& node, const std::string& source) {
  const std::string_view name = node.name();
  const auto value = [&](const char* key) { return length_of(node, key, source); };
  if (name == "path") return SvgPath(node.attribute("d").as_string(), source).flatten();
  if (name == "polygon" || name == "polyline") {
    SvgScanner scan(node.attribute("points").as_string(), source);
    Points points;
    while (!scan.at_end()) add(points, scan.point(), source);
    return points;
  }
  if (name == "circle") {
    return ellipse_points({value("cx"), value("cy")}, Vector2d::Constant(value("r")));
  }
  if (name == "ellipse") {
    return ellipse_points({value("cx"), value("cy")}, {value("rx"), value("ry")});
  }
  if (name == "rect") {
    if (value("rx") != 0.0 || value("ry") != 0.0) {
      throw InvalidInput(source + ": rounded corners are not read; make the shape a path");
    }
    const Vector2d a(value("x"), value("y")), size(value("width"), value("height"));
    return Points{a, a + Vector2d(size.x(), 0), a + size, a + Vector2d(0, size.y())};
  }
  return std::nullopt;
}

struct Shape {
  std::string id;
  Points points;
};

// Shapes of a node and what it holds, in document order. pugixml's tree is as deep as the file
// makes it, so depth is bounded here.
void collect(const pugi::xml_node& node, const Eigen::Affine2d& outer, const std::string& source,
             int depth, std::vector<Shape>& shapes) {
  if (depth > 64) throw InvalidInput(source + ": groups nest deeper than 64 levels");
  for (const pugi::xml_node& child : node.children()) {
    const std::string_view name = child.name();
    if (name == "defs" || name == "clipPath" || name == "mask" || name == "symbol") continue;
    const std::string id = child.attribute("id").as_string();
    const std::string place =
        id.empty() ? fmt::format("{}: {}", source, text::quoted(name))
                   : fmt::format("{}: {} {}", source, text::quoted(name), text::quoted(id));
    const Eigen::Affine2d here =
        outer * parse_transform(child.attribute("transform").as_string(), place);
    if (auto points = shape_points(child, place)) {
      for (Vector2d& p : *points) p = here * p;
      if (shapes.size() == 10000) throw InvalidInput(source + ": more than 10000 shapes");
      shapes.push_back({id, std::move(*points)});
    }
    collect(child, here, source, depth + 1, shapes);
  }
}

}  // namespace

Matrix2Xd parse_outline_table(std::string_view content, const std::string& source) {
  text::Lines lines(content);
  Points points;
  for (std::string_view line; lines.next(line);) {
    std::string spaced(line);
    for (char& c : spaced) c = c == ',' || c == ';' || c == '\t' ? ' ' : c;
    std::string_view rest = spaced;
    const std::string_view first = text::next_word(rest);
    if (first.empty() || first[0] == '#') continue;
    Vector2d p;
    if (!text::parse(first, p.x()) || !text::parse(text::next_word(rest), p.y()) ||
        !text::next_word(rest).empty()) {
      throw InvalidInput(fmt::format("{}:{}: {} is not a point; two finite numbers were expected",
                                     source, lines.number(), text::quoted(line)));
    }
    add(points, p, source);
  }
  return closed(std::move(points), source);
}

Matrix2Xd parse_outline_svg(std::string_view content, const std::string& source,
                            const std::string& id) {
  pugi::xml_document document;
  const auto result = document.load_buffer(content.data(), content.size());
  if (!result) {
    throw InvalidInput(fmt::format("{}: not an SVG drawing: {} (at byte {})", source,
                                   result.description(), result.offset));
  }
  std::vector<Shape> shapes;
  collect(document, Eigen::Affine2d::Identity(), source, 0, shapes);
  if (!id.empty()) std::erase_if(shapes, [&](const Shape& s) { return s.id != id; });
  if (shapes.size() != 1) {
    throw InvalidInput(
        id.empty() ? fmt::format("{}: {} shapes; a contour is one shape: leave one, or name its id",
                                 source, shapes.size())
                   : fmt::format("{}: {} shapes have the id {}; one was expected", source,
                                 shapes.size(), text::quoted(id)));
  }
  for (Vector2d& p : shapes[0].points) {
    p.y() = -p.y();
    if (!p.allFinite()) throw InvalidInput(source + ": a coordinate is not finite");
  }
  return closed(std::move(shapes[0].points), source);
}

Matrix2Xd read_outline(const std::string& path, const std::string& id) {
  constexpr std::uintmax_t limit_bytes = std::uintmax_t{16} << 20;
  const std::string extension = text::lower_extension(path);
  if (extension == ".svg") return parse_outline_svg(text::read_file(path, limit_bytes), path, id);
  if (extension == ".csv" || extension == ".txt") {
    return parse_outline_table(text::read_file(path, limit_bytes), path);
  }
  throw InvalidInput(path + ": contours are read from .csv, .txt or .svg files");
}

}  // namespace semblance
