// OpenCV's FileStorage, YAML or XML, with one camera as the calibration samples write it (and ROS,
// whose camera_info is the same without tags), or two with the pose of the second in the first.
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <map>
#include <opencv2/core.hpp>
#include <pugixml.hpp>

#include "camera_format.h"
#include "parsers.h"
#include "semblance/core/errors.h"
#include "semblance/io/text.h"
#include "yaml.h"

namespace semblance {
namespace {

/// A top-level entry: a text, or a matrix (a list of numbers is a column), or neither.
struct Entry {
  std::string key{};   // as written
  std::string text{};  // empty for a matrix
  int rows = 0, columns = 0;
  std::vector<double> values{};  // row by row
};

/// Samples and programs differ in capitals and underscores: camera_matrix, cameraMatrix.
std::string plain_key(std::string_view key) {
  std::string plain;
  for (const char c : key) {
    if (c != '_') plain += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return plain;
}

class Storage {
 public:
  Storage(std::map<std::string, Entry> entries, const std::string& source)
      : entries_(std::move(entries)), source_(source) {}

  const Entry* find(std::initializer_list<const char*> keys) {
    const Entry* found = nullptr;
    for (const char* key : keys) {
      const auto it = entries_.find(key);
      if (it == entries_.end()) continue;
      used_.insert(key);
      if (found == nullptr) found = &it->second;
    }
    return found;
  }
  const Entry& need(std::initializer_list<const char*> keys, const std::string& expected) {
    const Entry* entry = find(keys);
    if (entry == nullptr) throw InvalidInput(source_ + ": has no " + expected);
    return *entry;
  }
  [[noreturn]] void fail(const Entry& entry, const std::string& expected) const {
    throw InvalidInput(
        fmt::format("{}: {}: expected {}", source_, text::quoted(entry.key), expected));
  }
  double number(const Entry& entry) const {
    double value = 0.0;
    if (entry.values.size() == 1) return entry.values[0];
    if (!text::parse(entry.text, value)) fail(entry, "a number");
    return value;
  }
  Eigen::Matrix3d matrix3(const Entry& entry) const {
    if (entry.values.size() != 9) fail(entry, "a matrix of 3 x 3 finite numbers");
    return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(entry.values.data());
  }
  Eigen::Vector3d vector3(const Entry& entry) const {
    if (entry.values.size() != 3) fail(entry, "a vector of 3 finite numbers");
    return Eigen::Vector3d::Map(entry.values.data());
  }
  std::set<std::string> unused() const {
    std::set<std::string> keys;
    for (const auto& [key, entry] : entries_) {
      if (used_.count(key) == 0) keys.insert(text::quoted(entry.key));
    }
    return keys;
  }
  const std::string& source() const { return source_; }

 private:
  std::map<std::string, Entry> entries_;
  const std::string& source_;
  std::set<std::string> used_;
};

[[noreturn]] void refuse_matrix(const std::string& source, const std::string& key) {
  throw InvalidInput(
      fmt::format("{}: {}: expected a matrix with rows, cols and as many finite "
                  "numbers in data",
                  source, text::quoted(key)));
}

void check_matrix(const Entry& entry, const std::string& source) {
  constexpr int most = 1 << 20;
  const bool sized = entry.rows >= 0 && entry.columns >= 0 && entry.rows <= most &&
                     entry.columns <= most &&
                     entry.values.size() == static_cast<std::size_t>(entry.rows) *
                                                static_cast<std::size_t>(entry.columns);
  if (!sized) refuse_matrix(source, entry.key);
}

bool is_matrix_key(const std::string& plain) {
  // The only ones whose contents are looked at; others may be of any form.
  static const std::set<std::string> keys{"cameramatrix",
                                          "distortioncoefficients",
                                          "distcoeffs",
                                          "k",
                                          "m",
                                          "d",
                                          "k1",
                                          "m1",
                                          "d1",
                                          "k2",
                                          "m2",
                                          "d2",
                                          "r",
                                          "t",
                                          "rvec",
                                          "tvec",
                                          "imagesize"};
  return keys.count(plain) != 0;
}

Entry entry_of(const YAML::Node& node, const std::string& key, const std::string& source) {
  Entry entry{.key = key};
  if (node.IsScalar()) entry.text = node.Scalar();
  if (!is_matrix_key(plain_key(key)) || node.IsScalar()) return entry;
  const YAML::Node data = node.IsMap() ? node["data"] : node;
  const auto values = data ? yaml::numbers(data) : std::nullopt;
  if (!values) refuse_matrix(source, key);
  entry.values = *values;
  entry.rows = static_cast<int>(entry.values.size());
  entry.columns = 1;
  if (!node.IsMap()) return entry;
  const YAML::Node rows = node["rows"], columns = node["cols"];
  if (!rows || !columns || !rows.IsScalar() || !columns.IsScalar() ||
      !text::parse(rows.Scalar(), entry.rows) || !text::parse(columns.Scalar(), entry.columns)) {
    refuse_matrix(source, key);
  }
  check_matrix(entry, source);
  return entry;
}

std::map<std::string, Entry> yaml_entries(std::string_view content, const std::string& source) {
  const YAML::Node root = yaml::parse(content, source);
  if (!root.IsMap()) throw InvalidInput(source + ": expected a map of keys, as OpenCV writes it");
  std::map<std::string, Entry> entries;
  for (const auto& pair : root) {
    if (!pair.first.IsScalar()) continue;
    const std::string key = pair.first.Scalar();
    entries.emplace(plain_key(key), entry_of(pair.second, key, source));
  }
  return entries;
}

std::vector<double> xml_numbers(const std::string& words, const std::string& source,
                                const std::string& key) {
  std::vector<double> values;
  text::Lines lines(words);
  for (std::string_view line; lines.next(line);) {
    for (std::string_view word = text::next_word(line); !word.empty();
         word = text::next_word(line)) {
      double value = 0.0;
      if (!text::parse(word, value)) refuse_matrix(source, key);
      values.push_back(value);
    }
  }
  return values;
}

Entry entry_of(const pugi::xml_node& node, const std::string& source) {
  Entry entry{.key = node.name(), .text = node.text().get()};
  // OpenCV puts texts with anything but letters into quotes.
  std::string& words = entry.text;
  if (words.size() > 1 && words.front() == '"' && words.back() == '"') {
    words = words.substr(1, words.size() - 2);
  }
  if (!is_matrix_key(plain_key(entry.key))) return entry;
  const pugi::xml_node data = node.child("data");
  entry.values = xml_numbers(data ? data.text().get() : entry.text, source, entry.key);
  entry.rows = static_cast<int>(entry.values.size());
  entry.columns = 1;
  if (!data) return entry;
  if (!text::parse(node.child("rows").text().get(), entry.rows) ||
      !text::parse(node.child("cols").text().get(), entry.columns)) {
    refuse_matrix(source, entry.key);
  }
  check_matrix(entry, source);
  return entry;
}

std::map<std::string, Entry> xml_entries(std::string_view content, const std::string& source) {
  pugi::xml_document document;
  const pugi::xml_parse_result result = document.load_buffer(content.data(), content.size());
  if (!result) {
    throw InvalidInput(fmt::format("{}: is not valid XML at byte {}: {}", source, result.offset,
                                   result.description()));
  }
  std::map<std::string, Entry> entries;
  for (const pugi::xml_node& node : document.child("opencv_storage").children()) {
    if (node.type() != pugi::node_element) continue;
    entries.emplace(plain_key(node.name()), entry_of(node, source));
  }
  return entries;
}

void read_size(Storage& in, OpenCvCamera& camera) {
  if (const Entry* size = in.find({"imagesize"})) {
    if (size->values.size() != 2) in.fail(*size, "width and height");
    camera.width = size->values[0];
    camera.height = size->values[1];
    return;
  }
  const std::string remedy = " (the width and height of the pictures in pixels; add the lines)";
  camera.width = in.number(in.need({"imagewidth"}, "image_width" + remedy));
  camera.height = in.number(in.need({"imageheight"}, "image_height" + remedy));
}

bool is_fisheye(Storage& in) {
  if (const Entry* flag = in.find({"fisheyemodel"})) return in.number(*flag) != 0.0;
  const Entry* model = in.find({"distortionmodel"});
  if (model == nullptr) return false;
  // ROS's names; the first two are OpenCV's lens with 5 and 8 coefficients.
  static const std::set<std::string> plain{"plumb_bob", "rational_polynomial"};
  static const std::set<std::string> fisheye{"equidistant", "fisheye"};
  if (fisheye.count(model->text) != 0) return true;
  if (plain.count(model->text) != 0) return false;
  in.fail(*model, "plumb_bob, rational_polynomial or equidistant");
}

/// The pose of the first, or only, camera, where it is given.
bool read_pose(Storage& in, Rigid3& camera_from_world) {
  const Entry* rotation = in.find({"rvec"});
  const Entry* translation = in.find({"tvec"});
  if (rotation == nullptr && translation == nullptr) return false;
  if (rotation == nullptr || translation == nullptr) {
    in.fail(rotation == nullptr ? *translation : *rotation, "both rvec and tvec, or neither");
  }
  camera_from_world = {quaternion_from_rotation_vector(in.vector3(*rotation)),
                       in.vector3(*translation)};
  return true;
}

CameraFile read_single(Storage& in) {
  OpenCvCamera given;
  given.name = "camera";
  if (const Entry* name = in.find({"cameraname"}); name != nullptr && !name->text.empty()) {
    given.name = name->text;
  }
  read_size(in, given);
  given.matrix = in.matrix3(in.need({"cameramatrix", "k", "m"}, "camera_matrix"));
  given.distortion =
      in.need({"distortioncoefficients", "distcoeffs", "d"}, "distortion_coefficients").values;
  given.fisheye = is_fisheye(in);
  CameraFile file{.rig = {{from_opencv(given, in.source())}}};
  if (!read_pose(in, file.rig.cameras[0].camera_from_world)) note_no_poses(file.notes);
  return file;
}

CameraFile read_stereo(Storage& in) {
  OpenCvCamera first, second;
  first.name = "camera1";
  second.name = "camera2";
  read_size(in, first);
  second.width = first.width;
  second.height = first.height;
  first.matrix = in.matrix3(in.need({"k1", "m1"}, "K1"));
  second.matrix = in.matrix3(in.need({"k2", "m2"}, "K2"));
  first.distortion = in.need({"d1"}, "D1").values;
  second.distortion = in.need({"d2"}, "D2").values;
  first.fisheye = second.fisheye = is_fisheye(in);
  CameraFile file{.rig = {{from_opencv(first, in.source()), from_opencv(second, in.source())}}};
  const std::string remedy =
      " (the second camera's place in the first's frame); OpenCV's sample writes it to "
      "extrinsics.yml: copy it from there";
  const Rigid3 second_from_first{
      rotation_from_matrix(in.matrix3(in.need({"r"}, "R" + remedy)), in.source(), second.name),
      in.vector3(in.need({"t"}, "T" + remedy))};
  Rigid3& place = file.rig.cameras[0].camera_from_world;
  if (!read_pose(in, place)) {
    file.notes.emplace_back(
        "has no world: the first camera stands at the origin and looks along -z");
  }
  file.rig.cameras[1].camera_from_world = second_from_first * place;
  return file;
}

bool is_xml(const std::string& path) { return text::lower_extension(path) == ".xml"; }

bool recognises(const std::string& path, std::string_view content) {
  if (is_xml(path)) return content.find("<opencv_storage") != std::string_view::npos;
  if (!yaml::is_yaml(path)) return false;
  for (const char* sign : {"opencv-matrix", "camera_matrix", "%YAML:1.0"}) {
    if (content.find(sign) != std::string_view::npos) return true;
  }
  return false;
}

bool suits(const std::string& path) { return is_xml(path) || yaml::is_yaml(path); }

CameraFile read(const std::string& path) {
  return parse_opencv(text::read_file(path, camera_file_limit_bytes), path, is_xml(path));
}

template <class Matrix>
cv::Mat mat_of(const Matrix& matrix) {
  cv::Mat result(static_cast<int>(matrix.rows()), static_cast<int>(matrix.cols()), CV_64F);
  for (int r = 0; r < result.rows; ++r) {
    for (int c = 0; c < result.cols; ++c) result.at<double>(r, c) = matrix(r, c);
  }
  return result;
}

cv::Mat distortion_of(const Camera& camera) {
  std::vector<double> values = opencv_distortion(camera);
  if (values.empty()) values.resize(5);
  return mat_of(
      Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size())));
}

void write_first_pose(cv::FileStorage& out, const Camera& camera) {
  const Rigid3& pose = camera.camera_from_world;
  out << "rvec" << mat_of(rotation_vector_from_quaternion(pose.rotation));
  out << "tvec" << mat_of(pose.translation_m);
}

void write_head(cv::FileStorage& out, const Camera& camera) {
  out << "image_width" << camera.width << "image_height" << camera.height;
  out << "fisheye_model" << (camera.lens == Lens::fisheye ? 1 : 0);
}

void write_single(cv::FileStorage& out, const Camera& camera) {
  write_head(out, camera);
  out << "camera_name" << camera.name;
  out << "camera_matrix" << mat_of(opencv_matrix(camera));
  out << "distortion_coefficients" << distortion_of(camera);
  write_first_pose(out, camera);
}

void write_stereo(cv::FileStorage& out, const Camera& first, const Camera& second) {
  write_head(out, first);
  out << "K1" << mat_of(opencv_matrix(first)) << "D1" << distortion_of(first);
  out << "K2" << mat_of(opencv_matrix(second)) << "D2" << distortion_of(second);
  const Rigid3 second_from_first = second.camera_from_world * first.camera_from_world.inverse();
  out << "R" << mat_of(second_from_first.rotation.toRotationMatrix());
  out << "T" << mat_of(second_from_first.translation_m);
  write_first_pose(out, first);
}

void check_stereo(const std::string& path, const std::vector<Camera>& cameras) {
  if (cameras.size() > 2) {
    throw InvalidInput(
        fmt::format("{}: OpenCV's files hold one camera or a pair, not {}; choose "
                    "one with --camera, or another format",
                    path, cameras.size()));
  }
  const Camera &first = cameras.front(), &second = cameras.back();
  if (first.width != second.width || first.height != second.height) {
    throw InvalidInput(path +
                       ": OpenCV's file of a pair has one image size for both cameras, but "
                       "theirs differ; choose one with --camera, or another format");
  }
  if ((first.lens == Lens::fisheye) != (second.lens == Lens::fisheye)) {
    refuse_lens(path, first, "opencv",
                "pairs of fisheye lenses, or of others, but not one of each");
  }
}

std::vector<std::string> write(const std::string& path, const CameraFile& file) {
  const std::vector<Camera>& cameras = file.rig.cameras;
  check_stereo(path, cameras);
  const int form = is_xml(path) ? cv::FileStorage::FORMAT_XML : cv::FileStorage::FORMAT_YAML;
  cv::FileStorage out("", cv::FileStorage::WRITE | cv::FileStorage::MEMORY | form);
  std::vector<std::string> notes;
  if (cameras.size() == 1) {
    write_single(out, cameras[0]);
  } else {
    write_stereo(out, cameras[0], cameras[1]);
    notes.push_back(fmt::format("a pair has no names in OpenCV's files: {} is camera 1, {} is 2",
                                text::quoted(cameras[0].name), text::quoted(cameras[1].name)));
  }
  write_whole(path, out.releaseAndGetString());
  return notes;
}

}  // namespace

CameraFile parse_opencv(std::string_view content, const std::string& source, bool xml) {
  Storage in(xml ? xml_entries(content, source) : yaml_entries(content, source), source);
  const bool stereo = in.find({"k2", "m2"}) != nullptr;
  CameraFile file = stereo ? read_stereo(in) : read_single(in);
  note_unused(in.unused(), file.notes);
  return file;
}

const CameraFormat opencv_format{.name = "opencv",
                                 .title = "OpenCV YAML or XML",
                                 .has_unit = false,
                                 .recognises = recognises,
                                 .suits = suits,
                                 .read = read,
                                 .write = write};

}  // namespace semblance
