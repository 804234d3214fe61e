#include "range_map_header.h"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "semblance/core/errors.h"
#include "semblance/io/json_file.h"
#include "semblance/io/text.h"

namespace semblance {
namespace {

using Json = nlohmann::json;

constexpr const char* schema = "semblance.range_map/1";

/// Access to one object's keys with messages that name the source.
class Keys {
 public:
  Keys(const Json& object, std::string source) : object_(object), source_(std::move(source)) {
    if (!object_.is_object()) fail("a JSON object was expected (docs/formats/range_map.md)");
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw InvalidInput(source_ + ": " + what);
  }
  const Json& at(const char* key) const {
    const auto found = object_.find(key);
    if (found == object_.end()) {
      fail(fmt::format("the key \"{}\" is missing (docs/formats/range_map.md)", key));
    }
    return *found;
  }
  double number(const char* key) const { return finite(at(key), key); }
  int size(const char* key) const {
    const double value = number(key);
    if (value != std::floor(value) || value < 1 || value > most_range_samples_per_side) {
      fail(fmt::format("\"{}\" must be a whole number from 1 to {}", key,
                       most_range_samples_per_side));
    }
    return static_cast<int>(value);
  }
  std::string text(const char* key) const {
    const Json& value = at(key);
    if (!value.is_string()) fail(fmt::format("\"{}\" must be a text", key));
    return value.get<std::string>();
  }
  /// A name without folders, so that a header cannot reach beyond its own.
  std::string file_name(const char* key) const {
    const std::string name = text(key);
    if (name.empty() || name == "." || name == ".." ||
        name.find_first_of(std::string_view("/\\\0", 3)) != std::string::npos) {
      fail(fmt::format("\"{}\" must name a file in the header's own folder", key));
    }
    return name;
  }
  template <int Size>
  Eigen::Matrix<double, Size, 1> vector(const char* key) const {
    const Json& value = at(key);
    if (!value.is_array() || value.size() != Size) {
      fail(fmt::format("\"{}\" must be a list of {} numbers", key, Size));
    }
    Eigen::Matrix<double, Size, 1> result;
    for (int i = 0; i < Size; ++i) result[i] = finite(value[static_cast<std::size_t>(i)], key);
    return result;
  }

 private:
  double finite(const Json& value, const char* key) const {
    if (!value.is_number() || !std::isfinite(value.get<double>())) {
      fail(fmt::format("\"{}\" must hold finite numbers", key));
    }
    return value.get<double>();
  }

  const Json& object_;
  std::string source_;
};

Rigid3 parse_pose(const Keys& keys) {
  const Eigen::Vector4d q = keys.vector<4>("rotation_wxyz");
  constexpr double tolerance = 1e-6;
  if (!(std::abs(q.norm() - 1.0) < tolerance)) keys.fail("\"rotation_wxyz\" must have length 1");
  return {Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized(), keys.vector<3>("translation_m")};
}

}  // namespace

RangeMapHeader parse_range_map_header(std::string_view text, const std::string& source) {
  const Json json = parse_json(text, source);
  const Keys keys(json, source);
  if (keys.text("schema") != schema) {
    keys.fail(fmt::format("\"schema\" is {}; \"{}\" was expected",
                          text::quoted(keys.text("schema")), schema));
  }
  RangeMapHeader header;
  header.rows = keys.size("rows");
  header.columns = keys.size("columns");
  header.bottom_m = keys.number("bottom_m");
  header.spacing_m = keys.number("spacing_m");
  if (!(header.spacing_m > 0.0)) keys.fail("\"spacing_m\" must be positive");
  header.world_from_map = parse_pose(keys);
  header.radius_file = keys.file_name("radius_file");
  header.samples_file = keys.file_name("samples_file");
  const std::string encoding = keys.text("radius_encoding");
  if (encoding == "png16") {
    header.radius_step_m = keys.number("radius_step_m");
    if (!(header.radius_step_m > 0.0)) keys.fail("\"radius_step_m\" must be positive");
  } else if (encoding == "exr") {
    header.encoding = RangeEncoding::exr;
  } else {
    keys.fail(fmt::format("\"radius_encoding\" is {}; \"png16\" or \"exr\" was expected",
                          text::quoted(encoding)));
  }
  return header;
}

std::string format_range_map_header(const RangeMapHeader& header) {
  const Eigen::Quaterniond& q = header.world_from_map.rotation;
  const Eigen::Vector3d& t = header.world_from_map.translation_m;
  nlohmann::ordered_json json{
      {"schema", schema},
      {"rows", header.rows},
      {"columns", header.columns},
      {"bottom_m", header.bottom_m},
      {"spacing_m", header.spacing_m},
      {"rotation_wxyz", {q.w(), q.x(), q.y(), q.z()}},
      {"translation_m", {t.x(), t.y(), t.z()}},
      {"radius_file", header.radius_file},
      {"radius_encoding", header.encoding == RangeEncoding::exr ? "exr" : "png16"},
  };
  if (header.encoding == RangeEncoding::png16) json["radius_step_m"] = header.radius_step_m;
  json["samples_file"] = header.samples_file;
  return json.dump(2) + "\n";
}

}  // namespace semblance
