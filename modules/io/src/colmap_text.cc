// COLMAP's text models: words between blanks, lines that start with # are comments, and an image
// has two lines, of which the second, its 2D points, may be empty.
#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "colmap_files.h"
#include "semblance/core/errors.h"
#include "semblance/io/text.h"

namespace semblance::colmap {
namespace {

/// A file line by line, and the current line word by word.
class Reader {
 public:
  Reader(std::string_view content, std::string source)
      : lines_(content), source_(std::move(source)) {}

  /// The next line that has words and is no comment.
  bool next_record() {
    while (lines_.next(line_)) {
      const std::size_t start = line_.find_first_not_of(" \t");
      if (start != std::string_view::npos && line_[start] != '#') return true;
    }
    return false;
  }
  /// The next line whatever it holds; empty at the end.
  void next_line() {
    if (!lines_.next(line_)) line_ = {};
  }
  bool more_words() const { return line_.find_first_not_of(" \t") != std::string_view::npos; }

  std::string place() const { return fmt::format("{}, line {}", source_, lines_.number()); }
  [[noreturn]] void fail(const std::string& expected) const {
    throw InvalidInput(place() + ": expected " + expected);
  }

  std::string word(const char* what) {
    const std::string_view found = text::next_word(line_);
    if (found.empty()) fail(what);
    return std::string(found);
  }
  double number(const char* what) {
    double value = 0.0;
    if (!text::parse(text::next_word(line_), value)) fail(std::string(what) + ", a finite number");
    return value;
  }
  std::uint64_t count(const char* what) {
    std::uint64_t value = 0;
    if (!text::parse(text::next_word(line_), value)) fail(std::string(what) + ", a whole number");
    return value;
  }
  std::uint32_t id(const char* what) {
    const std::uint64_t value = count(what);
    if (value > std::numeric_limits<std::uint32_t>::max()) fail(std::string(what) + " of 32 bits");
    return static_cast<std::uint32_t>(value);
  }
  Eigen::Vector3d vector(const char* what) {
    const double x = number(what), y = number(what), z = number(what);
    return {x, y, z};
  }

 private:
  text::Lines lines_;
  std::string source_;
  std::string_view line_;
};

void read_cameras(Reader& in, ColmapModel& model) {
  while (in.next_record()) {
    const std::uint32_t id = in.id("CAMERA_ID");
    ColmapModel::Intrinsics camera;
    camera.model = in.word("the camera's MODEL");
    const int parameters = parameter_count(camera.model);
    if (parameters == 0) in.fail("a camera model with a lens here: " + known_models());
    camera.width = checked_size(in.count("WIDTH"), in.place());
    camera.height = checked_size(in.count("HEIGHT"), in.place());
    for (int i = 0; i < parameters; ++i) camera.parameters.push_back(in.number("PARAMS"));
    if (in.more_words()) in.fail(fmt::format("{} parameters and no more", parameters));
    if (!model.cameras.emplace(id, std::move(camera)).second) in.fail("each CAMERA_ID once");
  }
}

Eigen::Quaterniond read_rotation(Reader& in) {
  const double w = in.number("QW");
  const Eigen::Vector3d xyz = in.vector("QX, QY, QZ");
  Eigen::Quaterniond rotation(w, xyz.x(), xyz.y(), xyz.z());
  if (std::abs(rotation.norm() - 1.0) > 1e-3) in.fail("a unit quaternion QW, QX, QY, QZ");
  if (std::abs(rotation.norm() - 1.0) > 1e-12) rotation.normalize();
  return rotation;
}

void read_observations(Reader& in, ColmapModel::Image& image) {
  while (in.more_words()) {
    ColmapModel::Observation seen;
    seen.pixel.x() = in.number("X");
    seen.pixel.y() = in.number("Y");
    const std::string point = in.word("POINT3D_ID");
    if (point != "-1" && !text::parse(point, seen.point)) in.fail("POINT3D_ID, or -1 for none");
    image.observations.push_back(seen);
  }
}

void read_images(Reader& in, ColmapModel& model) {
  while (in.next_record()) {
    const std::uint32_t id = in.id("IMAGE_ID");
    ColmapModel::Image image;
    image.camera_from_world.rotation = read_rotation(in);
    image.camera_from_world.translation_m = in.vector("TX, TY, TZ");
    image.camera = in.id("CAMERA_ID");
    image.name = in.word("the image's NAME");
    if (in.more_words()) in.fail("an image name without blanks; COLMAP reads no others from text");
    in.next_line();
    read_observations(in, image);
    if (!model.images.emplace(id, std::move(image)).second) in.fail("each IMAGE_ID once");
  }
}

void read_points(Reader& in, ColmapModel& model) {
  while (in.next_record()) {
    const std::uint64_t id = in.count("POINT3D_ID");
    ColmapModel::Point point;
    point.position = in.vector("X, Y, Z");
    for (std::uint8_t& channel : point.colour) {
      const std::uint64_t value = in.count("R, G, B");
      if (value > 255) in.fail("colours from 0 to 255");
      channel = static_cast<std::uint8_t>(value);
    }
    point.error_px = in.number("ERROR");
    while (in.more_words()) {
      const std::uint32_t image = in.id("IMAGE_ID"), observation = in.id("POINT2D_IDX");
      point.track.push_back({image, observation});
    }
    if (!model.points.emplace(id, std::move(point)).second) in.fail("each POINT3D_ID once");
  }
}

void check_name(const std::string& name, const std::string& folder) {
  if (!name.empty() && name.find_first_of(" \t\r\n") == std::string::npos) return;
  throw InvalidInput(
      fmt::format("{}: the name {} is empty or has blanks, which COLMAP cannot read "
                  "from text; rename the camera, or write colmap-binary",
                  folder, text::quoted(name)));
}

std::string text_of_image(std::uint32_t id, const ColmapModel::Image& image) {
  const Eigen::Quaterniond& q = image.camera_from_world.rotation;
  const Eigen::Vector3d& t = image.camera_from_world.translation_m;
  std::string text = fmt::format("{} {} {} {} {} {} {} {} {} {}\n", id, q.w(), q.x(), q.y(), q.z(),
                                 t.x(), t.y(), t.z(), image.camera, image.name);
  const char* space = "";
  for (const ColmapModel::Observation& seen : image.observations) {
    text += fmt::format("{}{} {} ", space, seen.pixel.x(), seen.pixel.y());
    text += seen.point == ColmapModel::no_point ? "-1" : std::to_string(seen.point);
    space = " ";
  }
  return text + "\n";
}

}  // namespace

ColmapModel parse_text(const Contents& contents, const std::string& folder) {
  ColmapModel model;
  Reader cameras(contents.cameras, folder + "/cameras.txt");
  read_cameras(cameras, model);
  Reader images(contents.images, folder + "/images.txt");
  read_images(images, model);
  Reader points(contents.points, folder + "/points3D.txt");
  read_points(points, model);
  return model;
}

Contents text_of(const ColmapModel& model, const std::string& folder) {
  Contents contents{"# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n",
                    "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n"
                    "# POINTS2D[] as (X, Y, POINT3D_ID)\n",
                    "# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n"};
  for (const auto& [id, camera] : model.cameras) {
    contents.cameras += fmt::format("{} {} {} {} {}\n", id, camera.model, camera.width,
                                    camera.height, fmt::join(camera.parameters, " "));
  }
  for (const auto& [id, image] : model.images) {
    check_name(image.name, folder);
    contents.images += text_of_image(id, image);
  }
  for (const auto& [id, point] : model.points) {
    contents.points +=
        fmt::format("{} {} {} {} {} {}", id, point.position.x(), point.position.y(),
                    point.position.z(), fmt::join(point.colour, " "), point.error_px);
    for (const ColmapModel::TrackElement& element : point.track) {
      contents.points += fmt::format(" {} {}", element.image, element.observation);
    }
    contents.points += '\n';
  }
  return contents;
}

}  // namespace semblance::colmap
