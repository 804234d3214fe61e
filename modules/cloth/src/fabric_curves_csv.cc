// CSV of measured curves: lines of properties, the line of columns, then one reading per line.
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <map>

#include "csv_rows.h"
#include "fabric_parts.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"

namespace semblance {
namespace {

struct NamedUnit {
  const char* name;
  double scale;
};
using Units = std::vector<NamedUnit>;

const Units& deformation_units(ModeKind kind) {
  static const Units strain{{"1", 1.0}, {"%", kes::strain_from_pct}};
  static const Units angle{{"rad", 1.0}, {"deg", kes::rad_from_deg}};
  static const Units curvature{{"1/m", 1.0}, {"1/cm", kes::per_m_from_per_cm}};
  return kind == ModeKind::tension ? strain : kind == ModeKind::shear ? angle : curvature;
}

const Units& force_units(ModeKind kind) {
  static const Units force{{"N/m", 1.0}, {"gf/cm", kes::n_m_from_gf_cm}};
  static const Units moment{{"N m/m", 1.0}, {"gf cm/cm", kes::n_from_gf_cm_cm}};
  return kind == ModeKind::bending ? moment : force;
}

double scale_of(std::string_view unit, const Units& units, const CsvRows& rows) {
  std::string known;
  for (const NamedUnit& candidate : units) {
    if (unit == candidate.name) return candidate.scale;
    known += fmt::format("{}'{}'", known.empty() ? "" : " or ", candidate.name);
  }
  rows.fail(fmt::format("unit {} is not known here; {} was expected", text::quoted(unit), known));
}

enum Branch : std::size_t { loading, unloading, reverse_loading, reverse_unloading };
constexpr std::array<const char*, 4> k_branches{"loading", "unloading", "reverse_loading",
                                                "reverse_unloading"};
using Branches = std::array<Loop, 4>;

class CurvesParser {
 public:
  CurvesParser(std::string_view content, const std::string& source)
      : rows_(content, source), source_(source) {}

  FabricRecord parse() {
    read_properties();
    while (rows_.next(fields_)) read_sample();
    for (std::size_t mode = 0; mode < mode_count; ++mode) {
      if (!branches_[mode][loading].empty()) add_mode(mode);
      if (branches_[mode][loading].empty() && has_samples(mode)) {
        throw InvalidInput(
            fmt::format("{}: {} has no rows of branch 'loading'", source_, mode_names[mode].key));
      }
    }
    parts_.assumes_viscosity = parts_.assumes_reversal = true;
    return assemble_fabric(std::move(parts_), source_);
  }

 private:
  static constexpr const char* k_columns =
      "mode,branch,deformation,deformation_unit,force,force_unit";

  double number(std::string_view field) const {
    double value = 0.0;
    if (!text::parse(field, value) || std::abs(value) > 1e9) {
      rows_.fail(fmt::format("{} is not a number", text::quoted(field)));
    }
    return value;
  }

  void read_properties() {
    while (rows_.next(fields_)) {
      if (fields_[0] == "mode") return check_columns();
      read_property();
    }
    throw InvalidInput(
        fmt::format("{}: no line '{}', after which the readings follow (docs/formats/fabric.md)",
                    source_, k_columns));
  }

  void check_columns() const {
    std::string given;
    for (const std::string_view field : fields_) {
      given += fmt::format("{}{}", given.empty() ? "" : ",", field);
    }
    if (given != k_columns) rows_.fail(fmt::format("the columns must be {}", k_columns));
  }

  void read_property() {
    const std::string_view key = fields_[0];
    if (key == "name" && fields_.size() == 2) {
      parts_.name = std::string(fields_[1]);
    } else if (key == "area_density") {
      quantity(parts_.area_density_kg_m2, {{"kg/m2", 1.0}, {"g/m2", kes::kg_m2_from_g_m2}});
    } else if (key == "thickness") {
      quantity(parts_.thickness_m, {{"m", 1.0}, {"mm", kes::m_from_mm}});
    } else if (key == "friction" && fields_.size() == 2) {
      parts_.friction = number(fields_[1]);
    } else if (key == "mass_damping") {
      quantity(parts_.mass_damping_1_s, {{"1/s", 1.0}});
    } else {
      rows_.fail(
          fmt::format("{} was not expected; before the line '{}' there may be 'name,NAME', "
                      "'area_density,NUMBER,UNIT', 'thickness,NUMBER,UNIT', 'friction,NUMBER' and "
                      "'mass_damping,NUMBER,1/s'",
                      text::quoted(key), k_columns));
    }
  }

  void quantity(std::optional<double>& value, const Units& units) const {
    if (fields_.size() != 3) rows_.fail("a name, a number and a unit were expected");
    const double given = number(fields_[1]);
    if (given == 0.0) rows_.fail("must not be 0; leave the line out where it is not known");
    value = given * scale_of(fields_[2], units, rows_);
  }

  template <class Names, class NameOf>
  std::size_t index_of(std::string_view field, const Names& names, const NameOf& name_of) const {
    std::string known;
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (field == name_of(names[i])) return i;
      known += fmt::format("{}{}", i == 0 ? "" : ", ", name_of(names[i]));
    }
    rows_.fail(fmt::format("{} is none of {}", text::quoted(field), known));
  }

  void read_sample() {
    if (fields_.size() != 6) {
      rows_.fail(fmt::format("{} fields; 6 were expected: {}", fields_.size(), k_columns));
    }
    const std::size_t mode =
        index_of(fields_[0], mode_names, [](const ModeName& name) { return name.key; });
    const std::size_t branch =
        index_of(fields_[1], k_branches, [](const char* name) { return name; });
    const ModeKind kind = mode_names[mode].kind;
    LoopSample sample{number(fields_[2]) * scale_of(fields_[3], deformation_units(kind), rows_),
                      number(fields_[4]) * scale_of(fields_[5], force_units(kind), rows_)};
    if (branch >= reverse_loading) {
      if (kind == ModeKind::tension) rows_.fail("tension has no reverse branches");
      sample = {-sample.deformation, -sample.force};
    }
    if (!(sample.deformation >= 0.0)) {
      rows_.fail(branch >= reverse_loading
                     ? "deformations of reverse branches must not be positive"
                     : "deformations must not be negative; those of the other side belong to the "
                       "branches reverse_loading and reverse_unloading");
    }
    Loop& loop = branches_[mode][branch];
    if (loop.size() == most_curve_points) {
      rows_.fail(fmt::format("more than {} points in one branch", most_curve_points));
    }
    check_is_new(loop, sample);
    loop.push_back(sample);
  }

  /// Rows come in the order of the test, so only the last one can be the same.
  void check_is_new(const Loop& loop, const LoopSample& sample) const {
    if (!loop.empty() && loop.back().deformation == sample.deformation) {
      rows_.fail("the same deformation as in the row before; leave one of them out");
    }
  }

  bool has_samples(std::size_t mode) const {
    for (const Loop& loop : branches_[mode]) {
      if (!loop.empty()) return true;
    }
    return false;
  }

  void add_mode(std::size_t mode) {
    const Branches& given = branches_[mode];
    add_measured_mode(parts_, mode, {given[loading], given[unloading]}, 0.0, source_);
    if (given[reverse_loading].empty() != given[reverse_unloading].empty()) {
      throw InvalidInput(
          fmt::format("{}: {} has one of the branches reverse_loading and "
                      "reverse_unloading; both or none were expected",
                      source_, mode_names[mode].key));
    }
    if (!given[reverse_loading].empty()) add_reverse(mode);
  }

  /// The mode is the mean of both sides, and its loop goes on to the other one.
  void add_reverse(std::size_t mode) {
    FabricParts other;
    add_measured_mode(other, mode,
                      {branches_[mode][reverse_loading], branches_[mode][reverse_unloading]}, 0.0,
                      source_ + ": reverse side");
    ModeResponse& response = *parts_.modes[mode];
    const ModeResponse& reverse = *other.modes[mode];
    response.elastic = mean_curve(response.elastic, reverse.elastic);
    response.friction = mean_curve(response.friction, reverse.friction);
    response.reversal = 0.5 * (response.reversal + reverse.reversal);
    append_mirrored(loop_of(parts_.measured, mode), loop_of(other.measured, mode));
  }

  static void append_mirrored(Loop& loop, const Loop& reverse) {
    for (const LoopSample& sample : reverse) loop.push_back({-sample.deformation, -sample.force});
  }

  CsvRows rows_;
  std::string source_;
  std::vector<std::string_view> fields_;
  std::array<Branches, mode_count> branches_;
  FabricParts parts_;
};

/// Rows of a recorded loop, in KES units.
std::string loop_rows(std::size_t mode, const Loop& loop) {
  const ModeName& name = mode_names[mode];
  const ModeUnits units = units_of(name.kind, FabricUnits::kes);
  const char* const deformation_unit = deformation_units(name.kind)[1].name;
  const char* const force_unit = force_units(name.kind)[1].name;
  std::string text;
  std::size_t branch = loading;
  for (std::size_t i = 0; i < loop.size(); ++i) {
    const LoopSample& sample = loop[i];
    text += fmt::format("{},{},{:.9g},{},{:.9g},{}\n", name.key, k_branches[branch],
                        sample.deformation / units.deformation, deformation_unit,
                        sample.force / units.force, force_unit);
    if (i + 1 == loop.size()) break;
    const bool falls = loop[i + 1].deformation < sample.deformation;
    const bool turns = (branch == loading && falls) ||
                       (branch == unloading && falls && sample.deformation <= 0.0) ||
                       (branch == reverse_loading && !falls);
    if (turns) {
      ++branch;
      --i;  // a turn belongs to both branches
    }
  }
  return text;
}

/// Without what would end the field.
std::string plain_name(std::string name) {
  for (char& c : name) {
    if (c == ',' || c == '"' || (c >= 0 && c < ' ')) c = ' ';
  }
  return name;
}

}  // namespace

FabricRecord parse_fabric_curves(std::string_view content, const std::string& source) {
  return CurvesParser(content, source).parse();
}

void write_loops(const std::string& path, const std::string& name, const KesLoops& loops) {
  AtomicFile file(path);
  if (!name.empty()) file.stream() << "name," << plain_name(name) << '\n';
  file.stream() << "mode,branch,deformation,deformation_unit,force,force_unit\n";
  for (std::size_t mode = 0; mode < mode_count; ++mode) {
    file.stream() << loop_rows(mode, loop_of(loops, mode));
  }
  file.commit();
}

}  // namespace semblance
