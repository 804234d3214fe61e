#include "semblance/io/track_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>

#include "camera_json.h"
#include "parsers.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/core/version.h"
#include "semblance/io/json_file.h"
#include "semblance/io/text.h"

namespace semblance {
namespace {

using Json = nlohmann::json;
using OrderedJson = nlohmann::ordered_json;

constexpr const char* schema = "semblance.track/1";
/// The fields of a frame that are members of TrackFrame; all others are `extra`.
constexpr const char* frame_keys[] = {
    "frame",         "time_s",       "status",          "x",           "sigma", "rotation_wxyz",
    "translation_m", "residual_rms", "inlier_fraction", "landmarks_px"};
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

OrderedJson number_or_null(double value) {
  return std::isfinite(value) ? OrderedJson(value) : OrderedJson(nullptr);
}

template <typename Vector>
OrderedJson array_of(const Vector& values) {
  OrderedJson array = OrderedJson::array();
  for (Eigen::Index i = 0; i < values.size(); ++i) array.push_back(number_or_null(values[i]));
  return array;
}

/// One object per entry of x. Bounds of a rotation mean nothing and are null.
OrderedJson parameters_json(const ParameterSpace& space) {
  const std::vector<std::string> names = space.entry_names(), units = space.entry_units();
  OrderedJson list = OrderedJson::array();
  for (const ParameterBlock& block : space.blocks()) {
    for (int i = 0; i < block.size; ++i) {
      const bool bounded = block.manifold == Manifold::euclidean;
      OrderedJson entry;
      entry["name"] = names[list.size()];
      entry["unit"] = units[list.size()];
      entry["lower"] = number_or_null(bounded ? block.lower[i] : nan);
      entry["upper"] = number_or_null(bounded ? block.upper[i] : nan);
      list.push_back(std::move(entry));
    }
  }
  return list;
}

OrderedJson header_json(const TrackHeader& header) {
  OrderedJson json;
  json["schema"] = schema;
  json["program"] = program_version();
  json["kind"] = header.kind;
  json["seed"] = header.seed;
  json["parameters"] = parameters_json(header.parameters);
  json["cameras"] = OrderedJson::array();
  for (const Camera& camera : header.cameras) json["cameras"].push_back(json_from_camera(camera));
  json["frame_size"] = {header.width, header.height};
  json["landmark_names"] = header.landmark_names;
  json["config"] = header.config;
  return json;
}

void add_estimate(const TrackFrame& frame, OrderedJson& json) {
  json["x"] = array_of(frame.x);
  json["sigma"] = frame.sigma.size() == 0 ? OrderedJson(nullptr) : array_of(frame.sigma);
  if (frame.x.size() > 0) {
    json["rotation_wxyz"] = array_of(frame.rotation_wxyz);
    json["translation_m"] = array_of(frame.translation_m);
  }
  json["residual_rms"] = number_or_null(frame.residual_rms);
  json["inlier_fraction"] = number_or_null(frame.inlier_fraction);
  json["landmarks_px"] = OrderedJson::array();
  for (const Eigen::Vector2d& point : frame.landmarks_px) {
    json["landmarks_px"].push_back(array_of(point));
  }
}

OrderedJson frame_json(const TrackFrame& frame) {
  OrderedJson json;
  json["frame"] = frame.frame;
  json["time_s"] = number_or_null(frame.time_s);
  json["status"] = to_string(frame.status);
  if (frame.status != TrackStatus::lost) add_estimate(frame, json);
  for (const auto& [key, value] : frame.extra.items()) json[key] = value;
  return json;
}

[[noreturn]] void throw_io_error(const std::string& path, const char* what) {
  throw IoError(fmt::format("{}: {}: {}", path, what, std::strerror(errno != 0 ? errno : EIO)));
}

}  // namespace

std::string to_string(TrackStatus status) {
  switch (status) {
    case TrackStatus::tracked:
      return "tracked";
    case TrackStatus::reinitialised:
      return "reinitialised";
    case TrackStatus::lost:
      break;
  }
  return "lost";
}

struct TrackWriter::Impl {
  Impl(std::string path_in, std::ios::openmode mode) : path(std::move(path_in)) {
    errno = 0;
    stream.open(path, std::ios::binary | std::ios::out | mode);
    if (!stream) throw_io_error(path, "cannot be written");
  }

  void write_line(const OrderedJson& json) {
    // Text that is not UTF-8 (a file's name in `config`) must not cost the track.
    const std::string line =
        json.dump(-1, ' ', false, OrderedJson::error_handler_t::replace) + '\n';
    errno = 0;
    stream.write(line.data(), static_cast<std::streamsize>(line.size()));
    stream.flush();
    if (!stream) throw_io_error(path, "writing failed");
  }

  void check(const TrackFrame& frame) const;

  std::string path;
  std::ofstream stream;
  std::size_t parameter_count = 0;
  std::size_t landmark_count = 0;
  int last_frame = -1;
};

void TrackWriter::Impl::check(const TrackFrame& frame) const {
  const auto fail = [&](const std::string& what) {
    throw InvalidInput(fmt::format("{}: frame {}: {}", path, frame.frame, what));
  };
  if (frame.frame <= last_frame) {
    fail(fmt::format("comes after frame {}; numbers must ascend", last_frame));
  }
  if (!frame.extra.is_null() && !frame.extra.is_object()) fail("extra fields must be an object");
  for (const char* key : frame_keys) {
    if (frame.extra.is_object() && frame.extra.contains(key)) {
      fail(fmt::format("the extra field '{}' has the name of a standard one", key));
    }
  }
  if (frame.status == TrackStatus::lost) return;
  if (static_cast<std::size_t>(frame.x.size()) != parameter_count || !frame.x.allFinite()) {
    fail(fmt::format("a tracked frame needs {} finite parameter values", parameter_count));
  }
  if (frame.sigma.size() != 0 && frame.sigma.size() != frame.x.size()) {
    fail("sigma must have one entry per parameter, or none");
  }
  if (!frame.landmarks_px.empty() && frame.landmarks_px.size() != landmark_count) {
    fail(fmt::format("{} landmarks; the header names {}", frame.landmarks_px.size(),
                     landmark_count));
  }
}

TrackWriter::TrackWriter(const std::string& path, const TrackHeader& header)
    : impl_(std::make_unique<Impl>(path, std::ios::trunc)) {
  impl_->parameter_count = static_cast<std::size_t>(header.parameters.size());
  impl_->landmark_count = header.landmark_names.size();
  impl_->write_line(header_json(header));
}

TrackWriter::TrackWriter(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
TrackWriter::TrackWriter(TrackWriter&&) noexcept = default;
TrackWriter::~TrackWriter() = default;

void TrackWriter::write(const TrackFrame& frame) {
  impl_->check(frame);
  impl_->write_line(frame_json(frame));
  impl_->last_frame = frame.frame;
}

namespace {

/// Reads lines of one result file; knows their numbers for messages.
class TrackReader {
 public:
  TrackReader(std::string path, std::string_view content) : path_(std::move(path)) {
    const std::size_t end = content.rfind('\n');
    whole_bytes_ = end == std::string_view::npos ? 0 : end + 1;
    text::Lines lines(content.substr(0, whole_bytes_));
    std::string_view line;
    if (!lines.next(line)) {
      throw InvalidInput(path_ + ": has no whole line; a track file's first line is its header");
    }
    line_ = 1;
    read_header(line);
    while (lines.next(line)) {
      line_ = lines.number();
      track_.frames.push_back(read_frame(line));
    }
  }

  std::size_t whole_bytes() const { return whole_bytes_; }
  std::size_t parameter_count() const { return parameter_count_; }
  std::size_t landmark_count() const { return landmark_count_; }
  Track take() { return std::move(track_); }
  const Track& track() const { return track_; }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw InvalidInput(fmt::format("{}:{}: {}", path_, line_, what));
  }

  Json parse_object(std::string_view line) const {
    Json json = parse_json(line, fmt::format("{}:{}", path_, line_));
    if (!json.is_object()) fail("a JSON object was expected");
    return json;
  }

  void read_header(std::string_view line);
  TrackFrame read_frame(std::string_view line) const;
  void read_estimate(const Json& json, TrackFrame& frame) const;

  const Json& require(const Json& json, const char* key) const {
    const auto found = json.find(key);
    if (found == json.end()) fail(fmt::format("'{}' is missing", key));
    return *found;
  }

  double number(const Json& json, const char* key, bool may_be_null) const {
    if (json.is_number()) return json.get<double>();
    if (!json.is_null() || !may_be_null) fail(fmt::format("'{}' must hold numbers", key));
    return nan;
  }

  /// `null` within the array is read as NaN where that is allowed.
  Eigen::VectorXd numbers(const Json& json, const char* key, std::size_t count,
                          bool may_be_null) const {
    const Json& array = require(json, key);
    if (!array.is_array() || array.size() != count) {
      fail(fmt::format("'{}' must be an array of {} numbers", key, count));
    }
    Eigen::VectorXd values(static_cast<Eigen::Index>(count));
    for (std::size_t i = 0; i < count; ++i) values[i] = number(array[i], key, may_be_null);
    return values;
  }

  std::string path_;
  int line_ = 0;
  std::size_t whole_bytes_ = 0, parameter_count_ = 0, landmark_count_ = 0;
  Track track_;
};

void TrackReader::read_header(std::string_view line) {
  Json header = parse_object(line);
  if (header.value("schema", Json()) != schema) {
    fail(fmt::format("is not the header of a track file: 'schema' must be \"{}\"", schema));
  }
  for (const char* key : {"parameters", "landmark_names"}) {
    if (!require(header, key).is_array()) fail(fmt::format("'{}' must be an array", key));
  }
  for (const Json& parameter : header["parameters"]) {
    const bool usable = parameter.is_object() && parameter.value("name", Json()).is_string() &&
                        parameter.value("unit", Json()).is_string();
    if (!usable) fail("every entry of 'parameters' needs a 'name' and a 'unit'");
  }
  for (const Json& name : header["landmark_names"]) {
    if (!name.is_string()) fail("'landmark_names' must hold strings");
  }
  parameter_count_ = header["parameters"].size();
  landmark_count_ = header["landmark_names"].size();
  track_.header = std::move(header);
}

TrackStatus status_from(const Json& json, bool& known) {
  known = true;
  for (const auto status : {TrackStatus::tracked, TrackStatus::lost, TrackStatus::reinitialised}) {
    if (json == to_string(status)) return status;
  }
  known = false;
  return TrackStatus::lost;
}

TrackFrame TrackReader::read_frame(std::string_view line) const {
  Json json = parse_object(line);
  TrackFrame frame;
  const Json& index = require(json, "frame");
  const int previous = track_.frames.empty() ? -1 : track_.frames.back().frame;
  const double wide = index.is_number_integer() ? index.get<double>() : -1.0;
  if (!(wide > previous) || wide > std::numeric_limits<int>::max()) {
    fail("'frame' must be a whole number above that of the line before");
  }
  frame.frame = static_cast<int>(wide);
  frame.time_s = number(require(json, "time_s"), "time_s", true);
  bool status_known = false;
  frame.status = status_from(require(json, "status"), status_known);
  if (!status_known) fail("'status' must be \"tracked\", \"lost\" or \"reinitialised\"");
  frame.residual_rms = frame.inlier_fraction = nan;
  if (frame.status != TrackStatus::lost) read_estimate(json, frame);
  for (const char* key : frame_keys) json.erase(key);
  if (!json.empty()) frame.extra = std::move(json);
  return frame;
}

void TrackReader::read_estimate(const Json& json, TrackFrame& frame) const {
  frame.x = numbers(json, "x", parameter_count_, false);
  if (!require(json, "sigma").is_null()) {
    frame.sigma = numbers(json, "sigma", parameter_count_, true);
  }
  if (parameter_count_ > 0) {
    frame.rotation_wxyz = numbers(json, "rotation_wxyz", 4, false);
    frame.translation_m = numbers(json, "translation_m", 3, false);
  }
  frame.residual_rms = number(require(json, "residual_rms"), "residual_rms", true);
  frame.inlier_fraction = number(require(json, "inlier_fraction"), "inlier_fraction", true);
  const Json& landmarks = require(json, "landmarks_px");
  if (!landmarks.is_array() || (!landmarks.empty() && landmarks.size() != landmark_count_)) {
    fail(fmt::format("'landmarks_px' must be an array of {} points", landmark_count_));
  }
  for (const Json& point : landmarks) {
    if (!point.is_array() || point.size() != 2) fail("'landmarks_px' must hold pairs of numbers");
    frame.landmarks_px.emplace_back(number(point[0], "landmarks_px", true),
                                    number(point[1], "landmarks_px", true));
  }
}

}  // namespace

Track parse_track(std::string_view content, const std::string& source) {
  return TrackReader(source, content).take();
}

Track read_track(const std::string& path) { return parse_track(text::read_file(path), path); }

TrackWriter TrackWriter::append(const std::string& path) {
  const TrackReader reader(path, text::read_file(path));
  std::error_code error;
  std::filesystem::resize_file(path, reader.whole_bytes(), error);
  if (error) throw IoError(path + ": the torn last line cannot be cut off: " + error.message());
  auto impl = std::make_unique<Impl>(path, std::ios::app);
  impl->parameter_count = reader.parameter_count();
  impl->landmark_count = reader.landmark_count();
  if (!reader.track().frames.empty()) impl->last_frame = reader.track().frames.back().frame;
  return TrackWriter(std::move(impl));
}

namespace {

/// Fields of one row, quoted where RFC 4180 asks for it.
class CsvRow {
 public:
  void add(const std::string& field) {
    separate();
    if (field.find_first_of(",\"\r\n") == std::string::npos) {
      line_ += field;
      return;
    }
    line_ += '"';
    for (char c : field) line_ += c == '"' ? std::string("\"\"") : std::string(1, c);
    line_ += '"';
  }
  /// Nothing for a value that is not known.
  void add(double value) {
    separate();
    if (std::isfinite(value)) line_ += fmt::format("{}", value);
  }
  void add(int value) {
    separate();
    line_ += fmt::format("{}", value);
  }
  const std::string& end() { return line_ += "\r\n"; }

 private:
  void separate() {
    if (!first_) line_ += ',';
    first_ = false;
  }

  std::string line_;
  bool first_ = true;
};

CsvRow csv_heading(const Json& header) {
  CsvRow row;
  for (const char* name : {"frame", "time_s", "status"}) row.add(std::string(name));
  for (const char* prefix : {"", "sigma "}) {
    for (const Json& parameter : header["parameters"]) {
      row.add(fmt::format("{}{} [{}]", prefix, parameter["name"].get<std::string>(),
                          parameter["unit"].get<std::string>()));
    }
  }
  for (const char* name :
       {"rotation_w", "rotation_x", "rotation_y", "rotation_z", "translation_x_m",
        "translation_y_m", "translation_z_m", "residual_rms", "inlier_fraction"}) {
    row.add(std::string(name));
  }
  for (const Json& name : header["landmark_names"]) {
    row.add(name.get<std::string>() + "_x_px");
    row.add(name.get<std::string>() + "_y_px");
  }
  return row;
}

/// `count` values, NaN (an empty field) where the frame has none.
template <typename Vector>
void add_values(CsvRow& row, const Vector& values, std::size_t count, bool present) {
  for (std::size_t i = 0; i < count; ++i) {
    row.add(present && static_cast<Eigen::Index>(i) < values.size() ? values[i] : nan);
  }
}

CsvRow csv_row(const TrackFrame& frame, std::size_t parameter_count, std::size_t landmark_count) {
  const bool present = frame.status != TrackStatus::lost;
  CsvRow row;
  row.add(frame.frame);
  row.add(frame.time_s);
  row.add(to_string(frame.status));
  add_values(row, frame.x, parameter_count, present);
  add_values(row, frame.sigma, parameter_count, present);
  add_values(row, frame.rotation_wxyz, 4, present);
  add_values(row, frame.translation_m, 3, present);
  row.add(present ? frame.residual_rms : nan);
  row.add(present ? frame.inlier_fraction : nan);
  for (std::size_t i = 0; i < landmark_count; ++i) {
    const bool known = present && i < frame.landmarks_px.size();
    row.add(known ? frame.landmarks_px[i].x() : nan);
    row.add(known ? frame.landmarks_px[i].y() : nan);
  }
  return row;
}

}  // namespace

void write_track_csv(const std::string& path, const Track& track) {
  const std::size_t parameter_count = track.header.at("parameters").size();
  const std::size_t landmark_count = track.header.at("landmark_names").size();
  AtomicFile file(path);
  file.stream() << csv_heading(track.header).end();
  for (const TrackFrame& frame : track.frames) {
    file.stream() << csv_row(frame, parameter_count, landmark_count).end();
  }
  file.commit();
}

}  // namespace semblance
