#include "semblance/io/camera_formats.h"

#include <fmt/format.h>

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "camera_format.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/conventions.h"
#include "semblance/core/errors.h"
#include "semblance/io/text.h"

namespace semblance {
namespace {

std::string known_formats() {
  std::vector<std::string_view> names;
  for (const CameraFormat* format : camera_formats()) names.push_back(format->name);
  return fmt::format("{}", fmt::join(names, ", "));
}

std::string head_of(const std::string& path) {
  return std::filesystem::is_directory(path) ? "" : text::read_file(path, camera_file_limit_bytes);
}

[[noreturn]] void refuse(const std::string& source, const std::string& camera,
                         const std::string& what) {
  throw InvalidInput(fmt::format("{}: camera {}: {}", source, text::quoted(camera), what));
}

int whole_pixels(double pixels, const OpenCvCamera& camera, const std::string& source) {
  constexpr double largest = 65536;
  if (pixels >= 1 && pixels <= largest && pixels == std::floor(pixels)) {
    return static_cast<int>(pixels);
  }
  refuse(source, camera.name,
         fmt::format("the image size must be whole pixels from 1 to {}, not {} x {}", largest,
                     camera.width, camera.height));
}

/// Not every format can hold every byte.
void check_name(const std::string& name, const std::string& path) {
  const bool printable = std::none_of(name.begin(), name.end(), [](char c) {
    return static_cast<unsigned char>(c) < 0x20 || c == 0x7f;
  });
  try {
    if (printable && name.size() <= 1000 && !nlohmann::json(name).dump().empty()) return;
  } catch (const nlohmann::json::type_error&) {
    // Not UTF-8.
  }
  refuse(path, name, "a name must be UTF-8 of at most 1000 bytes without control characters");
}

}  // namespace

const std::vector<const CameraFormat*>& camera_formats() {
  // The first that recognises a file, or suits a name, is taken.
  static const std::vector<const CameraFormat*> formats{
      &semblance_format, &qualisys_format,   &kalibr_format,        &opencv_format,
      &caliscope_format, &aniposelib_format, &colmap_binary_format, &colmap_text_format};
  return formats;
}

const CameraFormat* find_camera_format(std::string_view name) {
  for (const CameraFormat* format : camera_formats()) {
    if (format->name == name) return format;
  }
  return nullptr;
}

const CameraFormat& recognise_camera_file(const std::string& path) {
  const std::string content = head_of(path);
  for (const CameraFormat* format : camera_formats()) {
    if (format->recognises(path, content)) return *format;
  }
  throw InvalidInput(
      fmt::format("{}: is of no format that is known here ({}); if it is, name the "
                  "format with --from to learn what is wrong with it",
                  path, known_formats()));
}

const CameraFormat& format_for_writing(const std::string& path) {
  for (const CameraFormat* format : camera_formats()) {
    if (format->suits(path)) return *format;
  }
  throw InvalidInput(
      fmt::format("{}: the name does not say which format to write; name it with "
                  "--to (one of {})",
                  path, known_formats()));
}

CameraFile read_cameras(const std::string& path, const CameraFormat& format,
                        double metres_per_unit) {
  CameraFile file = format.read(path);
  validate(file.rig, path);
  if (metres_per_unit == 1.0) return file;
  if (format.has_unit) {
    throw InvalidInput(fmt::format("{}: {} files say their unit of length; leave the unit away",
                                   path, format.name));
  }
  for (Camera& camera : file.rig.cameras) {
    camera.camera_from_world.translation_m *= metres_per_unit;
  }
  if (!file.model) return file;
  for (auto& [id, image] : file.model->images) {
    image.camera_from_world.translation_m *= metres_per_unit;
  }
  for (auto& [id, point] : file.model->points) point.position *= metres_per_unit;
  return file;
}

std::vector<std::string> write_cameras(const std::string& path, const CameraFile& file,
                                       const CameraFormat& format) {
  validate(file.rig, path);
  for (const Camera& camera : file.rig.cameras) check_name(camera.name, path);
  std::vector<std::string> notes = format.write(path, file);
  if (file.model && !format.keeps_model) {
    notes.push_back(
        fmt::format("not kept: COLMAP's 2D points and {} 3D points", file.model->points.size()));
  }
  return notes;
}

void set_brown_lens(Camera& camera, const LensCoefficients& coefficients) {
  const auto [k1, k2, p1, p2, k3, k4, k5, k6] = coefficients;
  camera.distortion = coefficients;
  if (k4 != 0.0 || k5 != 0.0 || k6 != 0.0) {
    camera.lens = Lens::brown8;
  } else if (p1 != 0.0 || p2 != 0.0 || k3 != 0.0) {
    camera.lens = Lens::brown5;
  } else {
    camera.lens = k1 != 0.0 || k2 != 0.0 ? Lens::brown2 : Lens::pinhole;
  }
}

Camera from_opencv(const OpenCvCamera& given, const std::string& source) {
  Camera camera;
  camera.name = given.name;
  camera.width = whole_pixels(given.width, given, source);
  camera.height = whole_pixels(given.height, given, source);
  camera.camera_from_world = default_pose();
  Eigen::Matrix3d plain = Eigen::Matrix3d::Identity();
  plain(0, 0) = given.matrix(0, 0);
  plain(1, 1) = given.matrix(1, 1);
  plain.col(2).head<2>() = given.matrix.col(2).head<2>();
  if (given.matrix != plain) {
    refuse(source, given.name,
           "the camera matrix must be [fx 0 cx; 0 fy cy; 0 0 1]; no lens here has a skew");
  }
  camera.focal_px = plain.diagonal().head<2>();
  camera.principal_px = ours_from_integer_centred(plain.col(2).head<2>());
  const std::vector<double>& k = given.distortion;
  const std::size_t most = given.fisheye ? 4 : 8;
  const bool more = std::any_of(k.begin() + static_cast<std::ptrdiff_t>(std::min(most, k.size())),
                                k.end(), [](double value) { return value != 0.0; });
  if (more) {
    refuse(source, given.name,
           fmt::format("{} distortion coefficients, of which those after the {}th are not zero "
                       "(thin prism, tilted sensor), have no lens here; calibrate without them",
                       k.size(), most));
  }
  if (given.fisheye && k.size() != 4) {
    refuse(source, given.name, "a fisheye lens must have 4 distortion coefficients");
  }
  LensCoefficients coefficients{};
  std::copy_n(k.begin(), std::min(most, k.size()), coefficients.begin());
  if (given.fisheye) {
    camera.lens = Lens::fisheye;
    camera.distortion = coefficients;
  } else {
    set_brown_lens(camera, coefficients);
  }
  validate(camera, source);
  return camera;
}

std::vector<double> opencv_distortion(const Camera& camera) {
  const LensCoefficients& k = camera.distortion;
  // OpenCV's shortest list with tangential terms has 4.
  const int count = camera.lens == Lens::brown2 ? 4 : coefficient_count(camera.lens);
  return {k.begin(), k.begin() + count};
}

Eigen::Matrix3d opencv_matrix(const Camera& camera) {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
  matrix.diagonal().head<2>() = camera.focal_px;
  matrix.col(2).head<2>() = integer_centred_from_ours(camera.principal_px);
  return matrix;
}

Eigen::Quaterniond rotation_from_matrix(const Eigen::Matrix3d& matrix, const std::string& source,
                                        const std::string& camera) {
  constexpr double rounding = 1e-3;
  if (!matrix.allFinite() || matrix.determinant() <= 0.0 ||
      !(matrix * matrix.transpose()).isIdentity(rounding)) {
    refuse(source, camera, "the rotation is not a rotation matrix (orthogonal, determinant 1)");
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return Eigen::Quaterniond(svd.matrixU() * svd.matrixV().transpose()).normalized();
}

void refuse_lens(const std::string& path, const Camera& camera, std::string_view format,
                 std::string_view holds) {
  refuse(path, camera.name,
         fmt::format("{} files cannot hold the lens {} with these coefficients (they hold {}); "
                     "write another format, or calibrate again with a lens that it holds",
                     format, lens_name(camera.lens), holds));
}

void note_unused(const std::set<std::string>& unused, std::vector<std::string>& notes) {
  if (!unused.empty()) notes.push_back(fmt::format("not kept: {}", fmt::join(unused, ", ")));
}

void note_no_poses(std::vector<std::string>& notes) {
  notes.emplace_back("has no poses: cameras stand at the origin and look along -z, upright");
}

void write_whole(const std::string& path, std::string_view content) {
  AtomicFile file(path);
  file.stream() << content;
  file.commit();
}

Rigid3 default_pose() { return Camera::centred(1, 1, 1.0).camera_from_world; }

}  // namespace semblance
