// Kalibr's camchain.yaml: cam0, cam1, ..., each posed in the frame of the one before.
#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include "camera_format.h"
#include "parsers.h"
#include "semblance/core/errors.h"
#include "semblance/io/text.h"
#include "yaml.h"

namespace semblance {
namespace {

constexpr std::string_view lenses_held =
    "pinhole, fisheye, brown2, and brown5 where k3 is 0; Kalibr calls them none, equidistant and "
    "radtan";

/// One camera's map with the place for messages.
class ChainReader {
 public:
  ChainReader(const YAML::Node& node, std::string camera, const std::string& source)
      : node_(node), camera_(std::move(camera)), source_(source) {
    if (!node.IsMap()) throw InvalidInput(source + ": " + camera_ + ": expected a map of keys");
  }

  bool has(const char* key) {
    used_.insert(key);
    return static_cast<bool>(node_[key]);
  }

  [[noreturn]] void fail(const char* key, const std::string& expected) const {
    throw InvalidInput(fmt::format("{}: {}: {}: expected {}", source_, camera_, key, expected));
  }

  std::string text(const char* key) {
    if (!has(key) || !node_[key].IsScalar()) fail(key, "a word");
    return node_[key].Scalar();
  }

  std::vector<double> numbers(const char* key, std::size_t count) {
    if (!has(key)) fail(key, fmt::format("{} numbers, but it is missing", count));
    const std::optional<std::vector<double>> values = yaml::numbers(node_[key]);
    if (!values || values->size() != count) fail(key, fmt::format("{} finite numbers", count));
    return *values;
  }

  void add_unused(std::set<std::string>& unused) const {
    for (const auto& entry : node_) {
      const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : "?";
      if (used_.count(key) == 0) unused.insert(text::quoted(key));
    }
  }

 private:
  const YAML::Node node_;
  std::string camera_;
  const std::string& source_;
  std::set<std::string> used_;
};

void read_distortion(ChainReader& in, OpenCvCamera& given) {
  const std::string model = in.text("distortion_model");
  if (model == "none") {
    in.has("distortion_coeffs");
  } else if (model == "radtan" || model == "equidistant") {
    given.distortion = in.numbers("distortion_coeffs", 4);
    given.fisheye = model == "equidistant";
  } else {
    in.fail("distortion_model", "none, radtan or equidistant; no lens here is like " +
                                    text::quoted(model) + ", calibrate with one of these");
  }
}

Rigid3 read_link(ChainReader& in, const std::string& source, const std::string& name) {
  const std::vector<double> values = in.numbers("T_cn_cnm1", 16);
  const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> matrix(values.data());
  if (matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1)) {
    in.fail("T_cn_cnm1", "a matrix whose last row is 0 0 0 1");
  }
  return {rotation_from_matrix(matrix.topLeftCorner<3, 3>(), source, name),
          matrix.topRightCorner<3, 1>()};
}

Camera read_camera_map(ChainReader& in, const std::string& name, const std::string& source) {
  if (const std::string model = in.text("camera_model"); model != "pinhole") {
    in.fail("camera_model", "pinhole; no lens here is like " + text::quoted(model));
  }
  OpenCvCamera given;
  given.name = name;
  const std::vector<double> size = in.numbers("resolution", 2);
  given.width = size[0];
  given.height = size[1];
  const std::vector<double> k = in.numbers("intrinsics", 4);
  given.matrix.diagonal().head<2>() << k[0], k[1];
  given.matrix.col(2).head<2>() << k[2], k[3];
  read_distortion(in, given);
  return from_opencv(given, source);
}

bool recognises(const std::string& path, std::string_view content) {
  return yaml::is_yaml(path) && content.find("cam0:") != std::string_view::npos &&
         content.find("distortion_model:") != std::string_view::npos;
}

bool suits(const std::string& path) {
  return yaml::is_yaml(path) && path.find("camchain") != std::string::npos;
}

CameraFile read(const std::string& path) {
  return parse_kalibr(text::read_file(path, camera_file_limit_bytes), path);
}

void write_distortion(YAML::Emitter& out, const Camera& camera, const std::string& path) {
  const bool more =
      camera.lens == Lens::brown8 || (camera.lens == Lens::brown5 && camera.distortion[4] != 0.0);
  if (more) refuse_lens(path, camera, "kalibr", lenses_held);
  std::vector<double> coefficients = opencv_distortion(camera);
  if (camera.lens != Lens::pinhole) coefficients.resize(4);
  const char* const model = camera.lens == Lens::pinhole   ? "none"
                            : camera.lens == Lens::fisheye ? "equidistant"
                                                           : "radtan";
  out << YAML::Key << "distortion_model" << YAML::Value << model;
  out << YAML::Key << "distortion_coeffs" << YAML::Value << YAML::Flow << coefficients;
}

void write_link(YAML::Emitter& out, const Rigid3& link) {
  Eigen::Matrix<double, 4, 4, Eigen::RowMajor> matrix;
  matrix << link.rotation.toRotationMatrix(), link.translation_m, 0, 0, 0, 1;
  matrix.array() += 0.0;  // no -0
  out << YAML::Key << "T_cn_cnm1" << YAML::Value << YAML::BeginSeq;
  for (int row = 0; row < 4; ++row) {
    const double* first = matrix.row(row).data();
    out << YAML::Flow << std::vector<double>(first, first + 4);
  }
  out << YAML::EndSeq;
}

void write_camera_map(YAML::Emitter& out, const Camera& camera, const std::string& path) {
  const Eigen::Matrix3d matrix = opencv_matrix(camera);
  out << YAML::Key << "camera_model" << YAML::Value << "pinhole";
  out << YAML::Key << "intrinsics" << YAML::Value << YAML::Flow
      << std::vector<double>{matrix(0, 0), matrix(1, 1), matrix(0, 2), matrix(1, 2)};
  write_distortion(out, camera, path);
  out << YAML::Key << "resolution" << YAML::Value << YAML::Flow
      << std::vector<int>{camera.width, camera.height};
}

bool is_default(const Rigid3& pose) {
  const Rigid3 usual = default_pose();
  return pose.rotation.coeffs() == usual.rotation.coeffs() &&
         pose.translation_m == usual.translation_m;
}

std::vector<std::string> write(const std::string& path, const CameraFile& file) {
  const std::vector<Camera>& cameras = file.rig.cameras;
  std::vector<std::string> notes;
  if (!is_default(cameras.front().camera_from_world)) {
    notes.push_back(fmt::format("Kalibr files have no world: places are kept relative to {} only",
                                text::quoted(cameras.front().name)));
  }
  YAML::Emitter out;
  out.SetDoublePrecision(17);
  out << YAML::BeginMap;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const std::string name = fmt::format("cam{}", i);
    if (cameras[i].name != name) {
      notes.push_back(fmt::format("Kalibr numbers its cameras: {} is now {}",
                                  text::quoted(cameras[i].name), name));
    }
    out << YAML::Key << name << YAML::Value << YAML::BeginMap;
    write_camera_map(out, cameras[i], path);
    if (i > 0) {
      write_link(out, cameras[i].camera_from_world * cameras[i - 1].camera_from_world.inverse());
    }
    out << YAML::EndMap;
  }
  out << YAML::EndMap;
  write_whole(path, std::string(out.c_str()) + "\n");
  return notes;
}

}  // namespace

CameraFile parse_kalibr(std::string_view content, const std::string& source) {
  const YAML::Node root = yaml::parse(content, source);
  CameraFile file;
  std::set<std::string> unused;
  for (std::size_t i = 0; root.IsMap() && i < most_rig_cameras; ++i) {
    const std::string name = fmt::format("cam{}", i);
    if (!root[name]) break;
    ChainReader in(root[name], name, source);
    Camera camera = read_camera_map(in, name, source);
    if (i > 0) {
      camera.camera_from_world =
          read_link(in, source, name) * file.rig.cameras.back().camera_from_world;
    }
    file.rig.cameras.push_back(camera);
    in.add_unused(unused);
  }
  if (file.rig.cameras.empty()) {
    throw InvalidInput(source +
                       ": has no cam0; expected a map of cam0, cam1, ... as Kalibr writes");
  }
  if (root.size() != file.rig.cameras.size()) {
    throw InvalidInput(
        fmt::format("{}: expected cam0 to cam{} and nothing else; number the "
                    "cameras without a gap",
                    source, root.size() - 1));
  }
  file.notes.emplace_back("has no world: the first camera stands at the origin and looks along -z");
  note_unused(unused, file.notes);
  return file;
}

const CameraFormat kalibr_format{.name = "kalibr",
                                 .title = "Kalibr camchain",
                                 .recognises = recognises,
                                 .suits = suits,
                                 .read = read,
                                 .write = write};

}  // namespace semblance
