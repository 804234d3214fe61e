#include "semblance/cameras/target.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>

#include "dictionaries.h"
#include "semblance/core/errors.h"

namespace semblance {

namespace {

constexpr int kMostPerSide = 200;
constexpr double kDefaultMarkerRatio = 0.75;
constexpr int kTagCount = 587;  // of tag36h11

constexpr const char* kForms =
    "chessboard:COLUMNSxROWS:SQUARE (inner corners), "
    "charuco:COLUMNSxROWS:SQUARE:DICTIONARY[:MARKER][:legacy] (squares), "
    "aprilgrid:COLUMNSxROWS:TAG:GAP[:borderN][:firstN] (tags; the gap in parts of a tag), "
    "circles:COLUMNSxROWS:STEP[:asymmetric], dots:COLUMNSxROWS:STEP, auto[:SIZE]; lengths in "
    "metres, "
    "as in chessboard:9x6:0.025";

/// Reads the fields of one text, front to back.
class TargetText {
 public:
  explicit TargetText(const std::string& text) : text_(text) {
    std::size_t start = 0;
    for (;;) {
      const std::size_t colon = text.find(':', start);
      fields_.push_back(text.substr(start, colon - start));
      if (colon == std::string::npos) break;
      start = colon + 1;
    }
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw InvalidInput(fmt::format("target '{}': {}. Sheets are named {}", text_, what, kForms));
  }

  bool at_end() const { return next_ == fields_.size(); }

  std::string take(const char* what) {
    if (at_end()) fail(fmt::format("{} is missing", what));
    return fields_[next_++];
  }

  void take_counts(Target& target) {
    const std::string field = take("COLUMNSxROWS");
    const std::size_t cross = field.find('x');
    const auto columns = integer(field.substr(0, cross));
    const auto rows = cross == std::string::npos ? std::nullopt : integer(field.substr(cross + 1));
    if (!columns || !rows) fail(fmt::format("'{}' is not COLUMNSxROWS, as in 9x6", field));
    target.columns = *columns;
    target.rows = *rows;
  }

  double take_length(const char* what) {
    const std::string field = take(what);
    const auto length = number(field);
    if (!length || *length <= 0.0 || *length > 100.0) {
      fail(fmt::format("{} '{}' is not a length in metres above 0 and up to 100", what, field));
    }
    return *length;
  }

  /// The whole number behind `prefix` where the next field is such a one.
  std::optional<int> take_option(const std::string& prefix) {
    if (at_end() || fields_[next_].rfind(prefix, 0) != 0) return std::nullopt;
    const auto value = integer(fields_[next_].substr(prefix.size()));
    if (value) ++next_;
    return value;
  }

  bool take_word(const char* word) {
    if (at_end() || fields_[next_] != word) return false;
    ++next_;
    return true;
  }

  /// A positive number where the next field is one.
  std::optional<double> take_number() {
    if (at_end()) return std::nullopt;
    const auto value = number(fields_[next_]);
    if (value) ++next_;
    return value;
  }

  void expect_end() const {
    if (!at_end()) fail(fmt::format("'{}' is not understood", fields_[next_]));
  }

 private:
  static std::optional<int> integer(const std::string& field) {
    int value = 0;
    const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
    if (error != std::errc() || end != field.data() + field.size()) return std::nullopt;
    return value;
  }

  static std::optional<double> number(const std::string& field) {
    double value = 0.0;
    const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
    if (error != std::errc() || end != field.data() + field.size() || !std::isfinite(value)) {
      return std::nullopt;
    }
    return value;
  }

  std::string text_;
  std::vector<std::string> fields_;
  std::size_t next_ = 0;
};

void check_counts(const TargetText& text, const Target& target, int least_columns, int least_rows) {
  if (target.columns < least_columns || target.rows < least_rows || target.columns > kMostPerSide ||
      target.rows > kMostPerSide) {
    text.fail(fmt::format("{}x{} is not between {}x{} and {}x{}", target.columns, target.rows,
                          least_columns, least_rows, kMostPerSide, kMostPerSide));
  }
}

void read_charuco(TargetText& text, Target& target) {
  target.dictionary = text.take("the dictionary");
  const auto size = dictionary_size(target.dictionary);
  if (!size) {
    text.fail(fmt::format("the dictionary '{}' is not one of {}", target.dictionary,
                          fmt::join(dictionary_names(), ", ")));
  }
  target.marker_m = text.take_number().value_or(kDefaultMarkerRatio * target.size_m);
  if (target.marker_m <= 0.0 || target.marker_m >= target.size_m) {
    text.fail("a marker must be smaller than its square");
  }
  target.legacy = text.take_word("legacy");
  check_counts(text, target, 2, 2);
  if (target.columns * target.rows / 2 > *size) {
    text.fail(fmt::format("{} has {} markers, the sheet needs {}", target.dictionary, *size,
                          target.columns * target.rows / 2));
  }
}

void read_aprilgrid(TargetText& text, Target& target) {
  const auto ratio = text.take_number();
  if (!ratio || *ratio <= 0.0 || *ratio > 5.0) {
    text.fail(
        "the gap in parts of a tag is missing or not in (0, 5], as in aprilgrid:6x6:0.088:0.3");
  }
  target.gap_ratio = *ratio;
  target.border_bits = text.take_option("border").value_or(1);
  if (target.border_bits < 1 || target.border_bits > 2) text.fail("borders are 1 or 2 bits wide");
  target.first_id = text.take_option("first").value_or(0);
  check_counts(text, target, 1, 1);
  if (target.first_id < 0 || target.first_id + target.columns * target.rows > kTagCount) {
    text.fail(fmt::format("tag36h11 has {} tags, the sheet needs ids {} to {}", kTagCount,
                          target.first_id, target.first_id + target.columns * target.rows - 1));
  }
}

int point_columns(const Target& target) {
  return target.kind == TargetKind::charuco ? target.columns - 1 : target.columns;
}

int point_rows(const Target& target) {
  return target.kind == TargetKind::charuco ? target.rows - 1 : target.rows;
}

void check_id(const Target& target, int id) {
  const std::vector<int> ids = point_ids(target);
  if (ids.empty() || id < ids.front() || id > ids.back()) {
    throw InvalidInput(fmt::format("the sheet {} has no point {}", target_text(target), id));
  }
}

Eigen::Vector3d tag_corner(const Target& target, int id) {
  const int tag = id / 4 - target.first_id, corner = id % 4;
  const double pitch_m = target.size_m * (1.0 + target.gap_ratio);
  const int column = tag % target.columns, row = target.rows - 1 - tag / target.columns;
  const bool right = corner == 1 || corner == 2, lower = corner < 2;
  return {column * pitch_m + (right ? target.size_m : 0.0),
          row * pitch_m + (lower ? target.size_m : 0.0), 0.0};
}

}  // namespace

Target parse_target(const std::string& name) {
  TargetText text(name);
  Target target;
  const std::string kind = text.take("the kind");
  if (kind == "auto") {
    if (!text.at_end()) target.size_m = text.take_length("the size");
    text.expect_end();
    return target;
  }
  const std::vector<std::pair<const char*, TargetKind>> kinds = {
      {"chessboard", TargetKind::chessboard},
      {"charuco", TargetKind::charuco},
      {"aprilgrid", TargetKind::aprilgrid},
      {"circles", TargetKind::circles},
      {"dots", TargetKind::dots}};
  const auto known =
      std::find_if(kinds.begin(), kinds.end(), [&](const auto& k) { return kind == k.first; });
  if (known == kinds.end()) text.fail(fmt::format("'{}' is no kind of sheet", kind));
  target.kind = known->second;
  text.take_counts(target);
  target.size_m = text.take_length("the size");
  switch (target.kind) {
    case TargetKind::charuco:
      read_charuco(text, target);
      break;
    case TargetKind::aprilgrid:
      read_aprilgrid(text, target);
      break;
    case TargetKind::circles:
      target.asymmetric = text.take_word("asymmetric");
      check_counts(text, target, 2, 2);
      break;
    case TargetKind::dots:
      check_counts(text, target, 4, 3);
      break;
    default:
      check_counts(text, target, 2, 2);
  }
  text.expect_end();
  return target;
}

std::string target_text(const Target& target) {
  const std::string counts_and_size =
      fmt::format("{}x{}:{}", target.columns, target.rows, target.size_m);
  switch (target.kind) {
    case TargetKind::automatic:
      return target.size_m > 0.0 ? fmt::format("auto:{}", target.size_m) : "auto";
    case TargetKind::chessboard:
      return "chessboard:" + counts_and_size;
    case TargetKind::charuco: {
      const bool usual = target.marker_m == kDefaultMarkerRatio * target.size_m;
      return fmt::format("charuco:{}:{}{}{}", counts_and_size, target.dictionary,
                         usual ? "" : fmt::format(":{}", target.marker_m),
                         target.legacy ? ":legacy" : "");
    }
    case TargetKind::aprilgrid:
      return fmt::format("aprilgrid:{}:{}{}{}", counts_and_size, target.gap_ratio,
                         target.border_bits > 1 ? fmt::format(":border{}", target.border_bits) : "",
                         target.first_id > 0 ? fmt::format(":first{}", target.first_id) : "");
    case TargetKind::circles:
      return "circles:" + counts_and_size + (target.asymmetric ? ":asymmetric" : "");
    case TargetKind::dots:
      return "dots:" + counts_and_size;
  }
  return {};
}

std::vector<int> point_ids(const Target& target) {
  const bool tags = target.kind == TargetKind::aprilgrid;
  const int count = point_columns(target) * point_rows(target) * (tags ? 4 : 1);
  std::vector<int> ids(count);
  for (int i = 0; i < count; ++i) ids[i] = 4 * target.first_id + i;
  return ids;
}

Eigen::Vector3d point_on_sheet(const Target& target, int id) {
  check_id(target, id);
  if (target.kind == TargetKind::aprilgrid) return tag_corner(target, id);
  const int columns = point_columns(target);
  double column = id % columns, row = id / columns;
  if (target.kind == TargetKind::charuco) {
    column += 1.0;
    row += 1.0;
  } else if (target.asymmetric) {
    column = 2.0 * column + (id / columns) % 2;
  }
  return {column * target.size_m, row * target.size_m, 0.0};
}

std::string point_name(const Target& target, int id) {
  check_id(target, id);
  if (target.kind == TargetKind::aprilgrid) {
    constexpr const char* corners[] = {"lower left", "lower right", "upper right", "upper left"};
    return fmt::format("tag {}, {}", id / 4, corners[id % 4]);
  }
  return fmt::format("column {}, row {}", id % point_columns(target), id / point_columns(target));
}

std::vector<Eigen::Vector2i> large_dots(const Target& target) {
  const Eigen::Vector2i middle((target.columns - 2) / 2, (target.rows - 1) / 2);
  return {middle, middle + Eigen::Vector2i(2, 0), middle + Eigen::Vector2i(0, 1)};
}

}  // namespace semblance
