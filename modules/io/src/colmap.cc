#include "semblance/io/colmap.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "camera_format.h"
#include "colmap_files.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/io/text.h"

namespace semblance {
namespace colmap {
namespace {

struct ModelRow {
  std::string_view name;
  int number, parameters;
};

// colmap/src/base/camera_models.h; those with a lens here.
constexpr ModelRow table[] = {{"SIMPLE_PINHOLE", 0, 3}, {"PINHOLE", 1, 4}, {"SIMPLE_RADIAL", 2, 4},
                              {"RADIAL", 3, 5},         {"OPENCV", 4, 8},  {"OPENCV_FISHEYE", 5, 8},
                              {"FULL_OPENCV", 6, 12}};

}  // namespace

int parameter_count(std::string_view model) {
  for (const ModelRow& row : table) {
    if (row.name == model) return row.parameters;
  }
  return 0;
}

std::string_view model_name(int number) {
  for (const ModelRow& row : table) {
    if (row.number == number) return row.name;
  }
  return {};
}

int model_number(std::string_view name) {
  for (const ModelRow& row : table) {
    if (row.name == name) return row.number;
  }
  return -1;
}

std::string known_models() {
  std::vector<std::string_view> names;
  for (const ModelRow& row : table) names.push_back(row.name);
  return fmt::format("{}", fmt::join(names, ", "));
}

int checked_size(std::uint64_t pixels, const std::string& place) {
  constexpr std::uint64_t largest = 65536;
  if (pixels >= 1 && pixels <= largest) return static_cast<int>(pixels);
  throw InvalidInput(
      fmt::format("{}: the image size must be 1 to {} pixels, not {}", place, largest, pixels));
}

}  // namespace colmap

namespace {

void check(bool holds, const std::string& source, const std::string& problem) {
  if (!holds) throw InvalidInput(source + ": " + problem);
}

void check_camera(std::uint32_t id, const ColmapModel::Intrinsics& camera,
                  const std::string& source) {
  const std::string where = fmt::format("{}: camera {}", source, id);
  const int count = colmap::parameter_count(camera.model);
  check(count > 0, where,
        fmt::format("its model is {}; with a lens here are {}", text::quoted(camera.model),
                    colmap::known_models()));
  check(camera.parameters.size() == static_cast<std::size_t>(count), where,
        fmt::format("{} has {} parameters, not {}", camera.model, count, camera.parameters.size()));
  check(std::all_of(camera.parameters.begin(), camera.parameters.end(),
                    [](double value) { return std::isfinite(value); }),
        where, "its parameters must be finite");
}

void check_image(std::uint32_t id, const ColmapModel::Image& image, const ColmapModel& model,
                 const std::string& source) {
  const std::string where = fmt::format("{}: image {}", source, id);
  check(model.cameras.count(image.camera) != 0, where,
        fmt::format("its camera {} is not in the model", image.camera));
  check(image.name.find('\0') == std::string::npos, where,
        "its name has a zero byte, which ends names in COLMAP");
  const Rigid3& pose = image.camera_from_world;
  check(pose.rotation.coeffs().allFinite() && std::abs(pose.rotation.norm() - 1.0) < 1e-6 &&
            pose.translation_m.allFinite(),
        where, "its pose must be a unit quaternion and a finite translation");
  for (std::size_t i = 0; i < image.observations.size(); ++i) {
    const ColmapModel::Observation& seen = image.observations[i];
    check(seen.pixel.allFinite(), where, fmt::format("its 2D point {} must be finite", i));
    if (seen.point == ColmapModel::no_point) continue;
    check(
        model.points.count(seen.point) != 0, where,
        fmt::format("its 2D point {} is of 3D point {}, which is not in the model", i, seen.point));
  }
}

void check_point(std::uint64_t id, const ColmapModel::Point& point, const ColmapModel& model,
                 const std::string& source) {
  const std::string where = fmt::format("{}: 3D point {}", source, id);
  check(point.position.allFinite() && std::isfinite(point.error_px), where,
        "its position and error must be finite");
  for (const ColmapModel::TrackElement& element : point.track) {
    const auto image = model.images.find(element.image);
    const bool there = image != model.images.end() &&
                       element.observation < image->second.observations.size() &&
                       image->second.observations[element.observation].point == id;
    check(there, where,
          fmt::format("its track names 2D point {} of image {}, which is not of this point",
                      element.observation, element.image));
  }
}

std::string file_in(const std::string& folder, const char* name, const char* extension) {
  return (std::filesystem::path(folder) / (std::string(name) + extension)).string();
}

bool has_all(const std::string& folder, const char* extension) {
  return std::filesystem::exists(file_in(folder, "cameras", extension)) &&
         std::filesystem::exists(file_in(folder, "images", extension)) &&
         std::filesystem::exists(file_in(folder, "points3D", extension));
}

colmap::Contents contents_of(const std::string& folder, const char* extension) {
  return {text::read_file(file_in(folder, "cameras", extension)),
          text::read_file(file_in(folder, "images", extension)),
          text::read_file(file_in(folder, "points3D", extension))};
}

void write_contents(const std::string& folder, const colmap::Contents& contents,
                    const char* extension) {
  prepare_output_folder(folder);
  AtomicFile cameras(file_in(folder, "cameras", extension));
  AtomicFile images(file_in(folder, "images", extension));
  AtomicFile points(file_in(folder, "points3D", extension));
  cameras.stream() << contents.cameras;
  images.stream() << contents.images;
  points.stream() << contents.points;
  cameras.commit();
  images.commit();
  points.commit();
}

Camera camera_of(const ColmapModel::Intrinsics& given) {
  Camera camera;
  camera.width = given.width;
  camera.height = given.height;
  const std::vector<double>& p = given.parameters;
  const bool one_focal =
      given.model == "SIMPLE_PINHOLE" || given.model == "SIMPLE_RADIAL" || given.model == "RADIAL";
  const std::size_t centre = one_focal ? 1 : 2;
  camera.focal_px << p[0], p[centre - 1];
  camera.principal_px << p[centre], p[centre + 1];
  LensCoefficients coefficients{};
  std::copy(p.begin() + static_cast<std::ptrdiff_t>(centre) + 2, p.end(), coefficients.begin());
  if (given.model == "OPENCV_FISHEYE") {
    camera.lens = Lens::fisheye;
    camera.distortion = coefficients;
  } else {
    set_brown_lens(camera, coefficients);
  }
  return camera;
}

ColmapModel::Intrinsics intrinsics_of(const Camera& camera) {
  const LensCoefficients& k = camera.distortion;
  const bool full = camera.lens == Lens::brown8 || (camera.lens == Lens::brown5 && k[4] != 0.0);
  const bool fisheye = camera.lens == Lens::fisheye;
  ColmapModel::Intrinsics result{.model = camera.lens == Lens::pinhole ? "PINHOLE"
                                          : fisheye                    ? "OPENCV_FISHEYE"
                                          : full                       ? "FULL_OPENCV"
                                                                       : "OPENCV",
                                 .width = camera.width,
                                 .height = camera.height,
                                 .parameters = {camera.focal_px.x(), camera.focal_px.y(),
                                                camera.principal_px.x(), camera.principal_px.y()}};
  const int coefficients = colmap::parameter_count(result.model) - 4;
  result.parameters.insert(result.parameters.end(), k.begin(), k.begin() + coefficients);
  return result;
}

bool has_files(const std::string& path, const char* extension) {
  return std::filesystem::is_directory(path) && has_all(path, extension);
}
bool recognises_text(const std::string& path, std::string_view) { return has_files(path, ".txt"); }
bool recognises_binary(const std::string& path, std::string_view) {
  return has_files(path, ".bin");
}
/// A folder, or what may become one.
bool suits_text(const std::string& path) {
  return std::filesystem::is_directory(path) ||
         std::filesystem::path(path).filename().string().find('.') == std::string::npos;
}
bool suits_binary(const std::string&) { return false; }

CameraFile file_of(ColmapModel model) {
  CameraFile file{.rig = rig_from_colmap(model)};
  if (model.images.empty()) note_no_poses(file.notes);
  file.notes.push_back(fmt::format("has {} images, one camera each, and {} points",
                                   model.images.size(), model.points.size()));
  file.model = std::move(model);
  return file;
}

CameraFile read_text(const std::string& folder) {
  ColmapModel model = colmap::parse_text(contents_of(folder, ".txt"), folder);
  validate(model, folder);
  return file_of(std::move(model));
}

CameraFile read_binary(const std::string& folder) {
  ColmapModel model = colmap::parse_binary(contents_of(folder, ".bin"), folder);
  validate(model, folder);
  return file_of(std::move(model));
}

ColmapModel model_of(const CameraFile& file) {
  return file.model ? *file.model : colmap_from_rig(file.rig);
}

std::vector<std::string> write_text(const std::string& folder, const CameraFile& file) {
  write_colmap_text(folder, model_of(file));
  return {};
}

std::vector<std::string> write_binary(const std::string& folder, const CameraFile& file) {
  write_colmap_binary(folder, model_of(file));
  return {};
}

}  // namespace

void validate(const ColmapModel& model, const std::string& source) {
  for (const auto& [id, camera] : model.cameras) check_camera(id, camera, source);
  for (const auto& [id, image] : model.images) check_image(id, image, model, source);
  for (const auto& [id, point] : model.points) check_point(id, point, model, source);
}

ColmapModel read_colmap(const std::string& folder) {
  const bool binary = has_all(folder, ".bin");
  if (!binary && !has_all(folder, ".txt")) {
    throw InvalidInput(folder +
                       ": expected a folder with cameras, images and points3D, all .bin "
                       "or all .txt, as COLMAP writes a sparse model");
  }
  return *(binary ? read_binary(folder) : read_text(folder)).model;
}

void write_colmap_text(const std::string& folder, const ColmapModel& model) {
  validate(model, folder);
  write_contents(folder, colmap::text_of(model, folder), ".txt");
}

void write_colmap_binary(const std::string& folder, const ColmapModel& model) {
  validate(model, folder);
  write_contents(folder, colmap::bytes_of(model), ".bin");
}

CameraRig rig_from_colmap(const ColmapModel& model) {
  CameraRig rig;
  for (const auto& [id, image] : model.images) {
    Camera camera = camera_of(model.cameras.at(image.camera));
    camera.name = image.name;
    camera.camera_from_world = image.camera_from_world;
    rig.cameras.push_back(std::move(camera));
  }
  if (!model.images.empty()) return rig;
  for (const auto& [id, intrinsics] : model.cameras) {
    Camera camera = camera_of(intrinsics);
    camera.name = fmt::format("camera_{}", id);
    camera.camera_from_world = default_pose();
    rig.cameras.push_back(std::move(camera));
  }
  return rig;
}

ColmapModel colmap_from_rig(const CameraRig& rig) {
  ColmapModel model;
  std::uint32_t id = 0;
  for (const Camera& camera : rig.cameras) {
    model.cameras[++id] = intrinsics_of(camera);
    model.images[id] = {.camera_from_world = camera.camera_from_world,
                        .camera = id,
                        .name = camera.name,
                        .observations = {}};
  }
  return model;
}

const CameraFormat colmap_text_format{.name = "colmap-text",
                                      .title = "COLMAP model, text",
                                      .has_unit = false,
                                      .keeps_model = true,
                                      .recognises = recognises_text,
                                      .suits = suits_text,
                                      .read = read_text,
                                      .write = write_text};

const CameraFormat colmap_binary_format{.name = "colmap-binary",
                                        .title = "COLMAP model, binary",
                                        .has_unit = false,
                                        .keeps_model = true,
                                        .recognises = recognises_binary,
                                        .suits = suits_binary,
                                        .read = read_binary,
                                        .write = write_binary};

}  // namespace semblance
