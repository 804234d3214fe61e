// COLMAP's binary models: little-endian, a count of 64 bits before every list. A count is believed
// only as far as there are bytes for it.
#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <cstring>

#include "colmap_files.h"
#include "semblance/core/errors.h"
#include "semblance/io/text.h"

namespace semblance::colmap {
namespace {

static_assert(std::endian::native == std::endian::little, "bytes are copied as they are");

class Reader {
 public:
  Reader(std::string_view bytes, std::string source) : rest_(bytes), source_(std::move(source)) {
    size_ = bytes.size();
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw InvalidInput(fmt::format("{}, byte {}: {}", source_, size_ - rest_.size(), what));
  }
  std::string place() const { return fmt::format("{}, byte {}", source_, size_ - rest_.size()); }

  template <class T>
  T get() {
    if (rest_.size() < sizeof(T)) fail("the file ends too early; copy or export it again");
    T value;
    std::memcpy(&value, rest_.data(), sizeof(T));
    rest_.remove_prefix(sizeof(T));
    return value;
  }
  double number(const char* what) {
    const double value = get<double>();
    if (!std::isfinite(value)) fail(std::string(what) + " is not finite");
    return value;
  }
  Eigen::Vector3d vector(const char* what) {
    const double x = number(what), y = number(what), z = number(what);
    return {x, y, z};
  }
  /// The length of a list whose elements have at least `element_bytes` each.
  std::uint64_t count(std::size_t element_bytes) {
    const auto value = get<std::uint64_t>();
    if (value > rest_.size() / element_bytes) {
      fail(fmt::format("a list of {} elements is longer than the file", value));
    }
    return value;
  }
  std::string name() {
    const std::size_t end = rest_.find('\0');
    if (end == std::string_view::npos) fail("a name does not end");
    const std::string result(rest_.substr(0, end));
    rest_.remove_prefix(end + 1);
    return result;
  }
  void finish() const {
    if (!rest_.empty()) fail("bytes are left over; this is not a file as COLMAP writes it");
  }

 private:
  std::string_view rest_;
  std::size_t size_ = 0;
  std::string source_;
};

constexpr std::size_t camera_bytes = 4 + 4 + 8 + 8 + 3 * 8;
constexpr std::size_t observation_bytes = 8 + 8 + 8;
constexpr std::size_t image_bytes = 4 + 7 * 8 + 4 + 1 + 8;
constexpr std::size_t track_bytes = 4 + 4;
constexpr std::size_t point_bytes = 8 + 3 * 8 + 3 + 8 + 8;

void read_cameras(Reader& in, ColmapModel& model) {
  for (std::uint64_t left = in.count(camera_bytes); left > 0; --left) {
    const auto id = in.get<std::uint32_t>();
    const auto number = in.get<std::int32_t>();
    ColmapModel::Intrinsics camera;
    camera.model = model_name(number);
    if (camera.model.empty()) {
      in.fail(fmt::format("camera {} has model number {}; with a lens here are {}", id, number,
                          known_models()));
    }
    camera.width = checked_size(in.get<std::uint64_t>(), in.place());
    camera.height = checked_size(in.get<std::uint64_t>(), in.place());
    for (int i = parameter_count(camera.model); i > 0; --i) {
      camera.parameters.push_back(in.number("a parameter"));
    }
    if (!model.cameras.emplace(id, std::move(camera)).second) {
      in.fail(fmt::format("camera {} is given twice", id));
    }
  }
  in.finish();
}

Eigen::Quaterniond read_rotation(Reader& in) {
  const double w = in.number("a quaternion");
  const Eigen::Vector3d xyz = in.vector("a quaternion");
  Eigen::Quaterniond rotation(w, xyz.x(), xyz.y(), xyz.z());
  if (std::abs(rotation.norm() - 1.0) > 1e-3) in.fail("a quaternion is not of length 1");
  if (std::abs(rotation.norm() - 1.0) > 1e-12) rotation.normalize();
  return rotation;
}

void read_images(Reader& in, ColmapModel& model) {
  for (std::uint64_t left = in.count(image_bytes); left > 0; --left) {
    const auto id = in.get<std::uint32_t>();
    ColmapModel::Image image;
    image.camera_from_world.rotation = read_rotation(in);
    image.camera_from_world.translation_m = in.vector("a translation");
    image.camera = in.get<std::uint32_t>();
    image.name = in.name();
    for (std::uint64_t points = in.count(observation_bytes); points > 0; --points) {
      ColmapModel::Observation seen;
      seen.pixel.x() = in.number("a 2D point");
      seen.pixel.y() = in.number("a 2D point");
      seen.point = in.get<std::uint64_t>();
      image.observations.push_back(seen);
    }
    if (!model.images.emplace(id, std::move(image)).second) {
      in.fail(fmt::format("image {} is given twice", id));
    }
  }
  in.finish();
}

void read_points(Reader& in, ColmapModel& model) {
  for (std::uint64_t left = in.count(point_bytes); left > 0; --left) {
    const auto id = in.get<std::uint64_t>();
    ColmapModel::Point point;
    point.position = in.vector("a 3D point");
    for (std::uint8_t& channel : point.colour) channel = in.get<std::uint8_t>();
    point.error_px = in.number("an error");
    for (std::uint64_t elements = in.count(track_bytes); elements > 0; --elements) {
      const auto image = in.get<std::uint32_t>(), observation = in.get<std::uint32_t>();
      point.track.push_back({image, observation});
    }
    if (!model.points.emplace(id, std::move(point)).second) {
      in.fail(fmt::format("3D point {} is given twice", id));
    }
  }
  in.finish();
}

template <class T>
void put(std::string& bytes, T value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof(T));
}

void put_vector(std::string& bytes, const Eigen::Vector3d& vector) {
  for (const double value : vector) put(bytes, value);
}

void put_image(std::string& bytes, std::uint32_t id, const ColmapModel::Image& image) {
  const Eigen::Quaterniond& q = image.camera_from_world.rotation;
  put(bytes, id);
  for (const double value : {q.w(), q.x(), q.y(), q.z()}) put(bytes, value);
  put_vector(bytes, image.camera_from_world.translation_m);
  put(bytes, image.camera);
  bytes.append(image.name).push_back('\0');
  put<std::uint64_t>(bytes, image.observations.size());
  for (const ColmapModel::Observation& seen : image.observations) {
    put(bytes, seen.pixel.x());
    put(bytes, seen.pixel.y());
    put(bytes, seen.point);
  }
}

void put_point(std::string& bytes, std::uint64_t id, const ColmapModel::Point& point) {
  put(bytes, id);
  put_vector(bytes, point.position);
  for (const std::uint8_t channel : point.colour) put(bytes, channel);
  put(bytes, point.error_px);
  put<std::uint64_t>(bytes, point.track.size());
  for (const ColmapModel::TrackElement& element : point.track) {
    put(bytes, element.image);
    put(bytes, element.observation);
  }
}

}  // namespace

ColmapModel parse_binary(const Contents& contents, const std::string& folder) {
  ColmapModel model;
  Reader cameras(contents.cameras, folder + "/cameras.bin");
  read_cameras(cameras, model);
  Reader images(contents.images, folder + "/images.bin");
  read_images(images, model);
  Reader points(contents.points, folder + "/points3D.bin");
  read_points(points, model);
  return model;
}

Contents bytes_of(const ColmapModel& model) {
  Contents contents;
  put<std::uint64_t>(contents.cameras, model.cameras.size());
  for (const auto& [id, camera] : model.cameras) {
    put(contents.cameras, id);
    put<std::int32_t>(contents.cameras, model_number(camera.model));
    put<std::uint64_t>(contents.cameras, static_cast<std::uint64_t>(camera.width));
    put<std::uint64_t>(contents.cameras, static_cast<std::uint64_t>(camera.height));
    for (const double value : camera.parameters) put(contents.cameras, value);
  }
  put<std::uint64_t>(contents.images, model.images.size());
  for (const auto& [id, image] : model.images) {
    put_image(contents.images, id, image);
  }
  put<std::uint64_t>(contents.points, model.points.size());
  for (const auto& [id, point] : model.points) put_point(contents.points, id, point);
  return contents;
}

}  // namespace semblance::colmap
