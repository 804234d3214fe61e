#include "semblance/io/radial_sweep_io.h"

#include <fmt/format.h>

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "parsers.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/io/json_file.h"
#include "semblance/io/json_reader.h"
#include "semblance/io/text.h"

namespace semblance {
namespace {

using Eigen::Index;
using Json = nlohmann::json;

constexpr const char* schema = "semblance.radial_sweep/1";
constexpr int most_side = static_cast<int>(most_range_samples_per_side);

const std::map<std::string, SweepForm>& forms() {
  static const std::map<std::string, SweepForm> names{{"single_scaling", SweepForm::single_scaling},
                                                      {"double_scaling", SweepForm::double_scaling},
                                                      {"cubic", SweepForm::cubic}};
  return names;
}

const std::map<std::string, JointTangent>& tangents() {
  static const std::map<std::string, JointTangent> names{{"given", JointTangent::given},
                                                         {"akima", JointTangent::akima},
                                                         {"monotone", JointTangent::monotone},
                                                         {"natural", JointTangent::natural},
                                                         {"crease", JointTangent::crease}};
  return names;
}

template <class T>
const std::string& name_of(const std::map<std::string, T>& names, T value) {
  return std::find_if(names.begin(), names.end(),
                      [value](const auto& entry) { return entry.second == value; })
      ->first;
}

// Reading.

/// A list of so many entries.
const Json& read_list(JsonReader& in, const char* key, Index count) {
  in.require(key);
  const Json& list = *in.find(key);
  if (!list.is_array() || static_cast<Index>(list.size()) != count) {
    in.fail(key, fmt::format("a list of {}", count));
  }
  return list;
}

float read_float(JsonReader& in, const char* key, const Json& entry) {
  constexpr double most = 1e30;
  if (!entry.is_number() || !(std::abs(entry.get<double>()) <= most)) {
    in.fail(key, fmt::format("finite numbers, none larger than {:g}", most));
  }
  return static_cast<float>(entry.get<double>());
}

/// `rows` lists of `columns` numbers.
Grid read_grid(JsonReader& in, const char* key, Index rows, Index columns) {
  Grid grid(rows, columns);
  Index row = 0;
  for (const Json& list : read_list(in, key, rows)) {
    if (!list.is_array() || static_cast<Index>(list.size()) != columns) {
      in.fail(key, fmt::format("{} lists of {} numbers", rows, columns));
    }
    for (Index column = 0; column < columns; ++column) {
      grid(row, column) = read_float(in, key, list[static_cast<std::size_t>(column)]);
    }
    ++row;
  }
  return grid;
}

std::vector<int> read_rows(JsonReader& in) {
  in.require("rows");
  const Json& list = *in.find("rows");
  if (!list.is_array() || list.size() > static_cast<std::size_t>(most_side)) {
    in.fail("rows", fmt::format("a list of at most {} rows", most_side));
  }
  std::vector<int> rows;
  for (const Json& entry : list) {
    if (!entry.is_number_integer() || entry.get<double>() < 0 || entry.get<double>() >= most_side) {
      in.fail("rows", fmt::format("whole numbers from 0 to {}", most_side - 1));
    }
    rows.push_back(entry.get<int>());
  }
  if (rows.size() < 2) in.fail("rows", "at least two contours, in the first and the last row");
  return rows;
}

std::vector<JointTangent> read_tangents(JsonReader& in, Index contours) {
  if (in.find("tangents") == nullptr) {
    return std::vector<JointTangent>(static_cast<std::size_t>(contours), JointTangent::given);
  }
  std::vector<JointTangent> result;
  for (const Json& entry : read_list(in, "tangents", contours)) {
    const auto found =
        entry.is_string() ? tangents().find(entry.get<std::string>()) : tangents().end();
    if (found == tangents().end()) {
      in.fail("tangents", "akima, crease, given, monotone or natural for each contour");
    }
    result.push_back(found->second);
  }
  return result;
}

/// One n for all segments, a list with one for each, or a list of one for each column of each.
Grid read_blend(JsonReader& in, Index segments, Index columns) {
  in.require("n");
  const Json& entry = *in.find("n");
  if (entry.is_number()) return Grid::Constant(segments, 1, read_float(in, "n", entry));
  const Json& list = read_list(in, "n", segments);
  if (list[0].is_array()) return read_grid(in, "n", segments, columns);
  Grid blend(segments, 1);
  for (Index i = 0; i < segments; ++i) {
    blend(i, 0) = read_float(in, "n", list[static_cast<std::size_t>(i)]);
  }
  return blend;
}

void read_slopes(JsonReader& in, SweepPanel& panel) {
  const Index contours = panel.radius_m.rows(), columns = panel.radius_m.cols();
  if (in.find("slope") != nullptr) {
    panel.slope_below = panel.slope_above = read_grid(in, "slope", contours, columns);
  } else {
    panel.slope_below = panel.slope_above = Grid::Zero(contours, columns);
    if (in.find("start_slope") == nullptr && in.find("end_slope") == nullptr) return;
    panel.slope_above.topRows(contours - 1) = read_grid(in, "start_slope", contours - 1, columns);
    panel.slope_below.bottomRows(contours - 1) = read_grid(in, "end_slope", contours - 1, columns);
  }
}

SweepPanel read_panel(JsonReader& in, int first_column) {
  SweepPanel panel;
  panel.first_column = first_column;
  int columns = 0;
  in.require("columns");
  in.number("columns", columns, 1, most_side);
  in.check();
  panel.rows = read_rows(in);
  const auto contours = static_cast<Index>(panel.rows.size());
  in.require("radius_m");
  panel.radius_m = read_grid(in, "radius_m", contours, columns);
  panel.tangent = read_tangents(in, contours);
  panel.blend = read_blend(in, contours - 1, columns);
  read_slopes(in, panel);
  return panel;
}

Rigid3 read_pose(JsonReader& in) {
  Eigen::Vector4d wxyz(1, 0, 0, 0);
  Rigid3 pose;
  in.vector("rotation_wxyz", wxyz);
  in.vector("translation_m", pose.translation_m);
  constexpr double tolerance = 1e-6;
  if (!(std::abs(wxyz.norm() - 1.0) < tolerance)) {
    in.fail("rotation_wxyz", "a quaternion of length 1");
  }
  pose.rotation = Eigen::Quaterniond(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
  return pose;
}

// Writing.

void append_list(fmt::memory_buffer& out, const Grid::ConstRowXpr& row) {
  fmt::format_to(std::back_inserter(out), "[{}]",
                 fmt::join(row.data(), row.data() + row.size(), ","));
}

void append_grid(fmt::memory_buffer& out, const char* key, const Grid& grid) {
  fmt::format_to(std::back_inserter(out), ",\n   \"{}\": [", key);
  for (Index i = 0; i < grid.rows(); ++i) {
    fmt::format_to(std::back_inserter(out), "{}", i > 0 ? ",\n    " : "");
    append_list(out, grid.row(i));
  }
  out.push_back(']');
}

void append_slopes(fmt::memory_buffer& out, const SweepPanel& panel) {
  const Index segments = panel.radius_m.rows() - 1;
  const bool none = (panel.slope_below == 0.0f).all() && (panel.slope_above == 0.0f).all();
  if (none) return;
  if ((panel.slope_below == panel.slope_above).all()) {
    append_grid(out, "slope", panel.slope_below);
  } else {
    append_grid(out, "start_slope", panel.slope_above.topRows(segments));
    append_grid(out, "end_slope", panel.slope_below.bottomRows(segments));
  }
}

void append_blend(fmt::memory_buffer& out, const Grid& blend) {
  if ((blend == blend(0, 0)).all()) {
    fmt::format_to(std::back_inserter(out), ",\n   \"n\": {}", blend(0, 0));
  } else if (blend.cols() == 1) {
    fmt::format_to(std::back_inserter(out), ",\n   \"n\": [{}]",
                   fmt::join(blend.data(), blend.data() + blend.size(), ","));
  } else {
    append_grid(out, "n", blend);
  }
}

void append_panel(fmt::memory_buffer& out, const RadialSweep& sweep, std::size_t index) {
  const SweepPanel& panel = sweep.panels[index];
  const auto to = std::back_inserter(out);
  fmt::format_to(to, "{}  {{\"columns\": {}", index > 0 ? ",\n" : "", panel.radius_m.cols());
  if (!sweep.closed_seams.empty()) {
    fmt::format_to(to, ", \"closed_seam\": {}", static_cast<bool>(sweep.closed_seams[index]));
  }
  fmt::format_to(to, ",\n   \"rows\": [{}]", fmt::join(panel.rows, ","));
  const bool given = std::all_of(panel.tangent.begin(), panel.tangent.end(),
                                 [](JointTangent t) { return t == JointTangent::given; });
  if (!given) {
    std::vector<std::string> names;
    for (const JointTangent tangent : panel.tangent) names.push_back(name_of(tangents(), tangent));
    fmt::format_to(to, ",\n   \"tangents\": [\"{}\"]", fmt::join(names, "\",\""));
  }
  append_blend(out, panel.blend);
  append_grid(out, "radius_m", panel.radius_m);
  append_slopes(out, panel);
  out.push_back('}');
}

std::string format_radial_sweep(const RadialSweep& sweep) {
  const Eigen::Quaterniond& q = sweep.world_from_map.rotation;
  const Eigen::Vector3d& t = sweep.world_from_map.translation_m;
  fmt::memory_buffer out;
  fmt::format_to(std::back_inserter(out),
                 "{{\"schema\": \"{}\",\n \"form\": \"{}\",\n \"rows\": {}, \"columns\": {},\n"
                 " \"bottom_m\": {}, \"spacing_m\": {},\n \"rotation_wxyz\": [{},{},{},{}], "
                 "\"translation_m\": [{},{},{}],\n \"numbers_stored\": {},\n \"panels\": [\n",
                 schema, name_of(forms(), sweep.form), sweep.row_count, sweep.column_count,
                 sweep.bottom_m, sweep.spacing_m, q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z(),
                 sweep.numbers_stored);
  for (std::size_t i = 0; i < sweep.panels.size(); ++i) append_panel(out, sweep, i);
  return fmt::to_string(out) + "]}\n";
}

}  // namespace

RadialSweep parse_radial_sweep(std::string_view content, const std::string& source) {
  const Json json = parse_json(content, source);
  JsonReader in(json, source);
  std::string found;
  in.text("schema", found);
  if (found != schema) in.fail("schema", fmt::format("\"{}\"", schema));
  RadialSweep sweep;
  for (const char* key :
       {"form", "rows", "columns", "bottom_m", "spacing_m", "numbers_stored", "panels"}) {
    in.required(key);
  }
  in.check();
  in.choice("form", forms(), sweep.form);
  in.number("rows", sweep.row_count, static_cast<double>(fewest_range_rows), most_side);
  in.number("columns", sweep.column_count, static_cast<double>(fewest_range_columns), most_side);
  constexpr double farthest_m = 1e6;
  in.number("bottom_m", sweep.bottom_m, -farthest_m, farthest_m);
  in.number("spacing_m", sweep.spacing_m, 1e-12, farthest_m);
  in.check();
  sweep.world_from_map = read_pose(in);
  in.number("numbers_stored", sweep.numbers_stored, 0, 1e12);
  int column = 0;
  std::vector<bool> closed;
  in.list("panels", [&](JsonReader& inner, std::size_t) {
    sweep.panels.push_back(read_panel(inner, column));
    column += static_cast<int>(sweep.panels.back().radius_m.cols());
    if (column > sweep.column_count) {
      inner.fail("columns", fmt::format("{} over all panels", sweep.column_count));
    }
    bool seam = false;
    inner.flag("closed_seam", seam);
    closed.push_back(seam);
  });
  in.finish();
  if (std::find(closed.begin(), closed.end(), true) != closed.end()) sweep.closed_seams = closed;
  try {
    validate(sweep);
  } catch (const InvalidInput& error) {
    throw InvalidInput(source + ": " + error.what());
  }
  return sweep;
}

RadialSweep read_radial_sweep(const std::string& path) {
  constexpr std::uintmax_t limit_bytes = std::uintmax_t{256} << 20;
  return parse_radial_sweep(text::read_file(path, limit_bytes), path);
}

void write_radial_sweep(const std::string& path, const RadialSweep& sweep) {
  validate(sweep);
  AtomicFile file(path);
  file.stream() << format_radial_sweep(sweep);
  file.commit();
}

}  // namespace semblance
