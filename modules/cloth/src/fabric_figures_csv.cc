// CSV of KES figures: a line of columns, then one fabric per line.
#include <fmt/format.h>

#include <algorithm>

#include "csv_rows.h"
#include "fabric_parts.h"
#include "semblance/core/errors.h"

namespace semblance {
namespace {

using Figure = KesFigures::Figure;
using Fields = std::vector<std::string_view>;

class FiguresParser {
 public:
  FiguresParser(std::string_view content, const std::string& source, const std::string& name)
      : rows_(content, source), source_(source), wanted_(name) {}

  FabricRecord parse() {
    rows_.next(columns_);
    check_columns();
    for (Fields fields; rows_.next(fields);) read_row(fields);
    if (!chosen_) throw_none();
    FabricRecord record;
    record.given = *chosen_;
    record.fabric = fabric_from_figures(*chosen_, place_);
    record.fabric.assumptions.insert(record.fabric.assumptions.begin(), inferred_.begin(),
                                     inferred_.end());
    record.loops = given_loops(record.fabric, record.given);
    return record;
  }

 private:
  /// Steady loops of the modes that have their main figure.
  static KesLoops given_loops(const Fabric& fabric, const KesFigures& given) {
    KesLoops loops = steady_loops(fabric);
    for (const std::size_t d : {warp, weft}) {
      const bool pulled = given.tension[d].emt_pct || given.tension[d].wt_gf_cm_cm2;
      if (!pulled) loops.tension[d].clear();
      if (!given.bending[d].b_gf_cm2_cm) loops.bending[d].clear();
    }
    if (!given.shear.g_gf_cm_deg) loops.shear.clear();
    return loops;
  }

  static std::vector<std::string> known_columns() {
    std::vector<std::string> known{"fabric", "source"};
    const KesFigures none;
    for_each_figure(none, [&](const FigureName& name, const Figure&) {
      const std::string column = name.column, direction = name.direction;
      if (std::find(known.begin(), known.end(), column) == known.end()) known.push_back(column);
      if (!direction.empty()) known.push_back(column + "_" + direction);
    });
    known.insert(known.end(), {"thickness_mm", "weight_g_m2", "DC_pct"});
    return known;
  }

  void check_columns() const {
    const std::vector<std::string> known = known_columns();
    for (auto column = columns_.begin(); column != columns_.end(); ++column) {
      if (std::find(known.begin(), known.end(), *column) == known.end()) {
        rows_.fail(fmt::format("column {} is not known; known are {}", text::quoted(*column),
                               fmt::join(known, ", ")));
      }
      if (std::find(columns_.begin(), column, *column) != column) {
        rows_.fail(fmt::format("column {} is there twice", text::quoted(*column)));
      }
    }
  }

  void read_row(const Fields& fields) {
    if (fields.size() != columns_.size()) {
      rows_.fail(
          fmt::format("{} fields; the first line has {} columns", fields.size(), columns_.size()));
    }
    const std::string name(fields[0]);
    if (name.empty()) rows_.fail("a fabric without a name");
    if (std::find(names_.begin(), names_.end(), name) != names_.end()) {
      rows_.fail(fmt::format("fabric {} is there twice", text::quoted(name)));
    }
    names_.push_back(name);
    if (!wanted_.empty() && name != wanted_) return;
    if (chosen_) throw_many();
    chosen_ = figures_of_row(fields);
    place_ = fmt::format("{}: {}", rows_.place(), name);
  }

  KesFigures figures_of_row(const Fields& fields) {
    KesFigures figures;
    figures.name = std::string(fields[0]);
    const auto text_column = std::find(columns_.begin(), columns_.end(), "source");
    if (text_column != columns_.end()) {
      figures.source =
          std::string(fields[static_cast<std::size_t>(text_column - columns_.begin())]);
    }
    for_each_figure(figures, [&](const FigureName& name, Figure& figure) {
      figure = number(fields, name.column);
      if (*name.direction == 0) return;
      figures.mean_of_directions |= figure.has_value();
      const Figure own = number(fields, fmt::format("{}_{}", name.column, name.direction));
      if (own && figure) {
        rows_.fail(fmt::format("{} is given with and without a direction", name.column));
      }
      if (own) figure = own;
    });
    figures.thickness_mm = number(fields, "thickness_mm");
    figures.weight_g_m2 = number(fields, "weight_g_m2");
    figures.drape_coefficient_pct = number(fields, "DC_pct");
    for (const Figure& figure : {figures.thickness_mm, figures.weight_g_m2}) {
      if (figure && !(*figure > 0.0)) rows_.fail("thickness and weight must be positive");
    }
    return figures;
  }

  /// Empty and "?" mean that it is not known; a star behind it that it was inferred.
  Figure number(const Fields& fields, const std::string& column) {
    const auto found = std::find(columns_.begin(), columns_.end(), column);
    if (found == columns_.end()) return std::nullopt;
    std::string_view field = fields[static_cast<std::size_t>(found - columns_.begin())];
    if (field.empty() || field == "?") return std::nullopt;
    const bool starred = field.back() == '*';
    if (starred) field.remove_suffix(1);
    double value = 0.0;
    if (!text::parse(field, value)) {
      rows_.fail(
          fmt::format("{} in column {} is not a number; leave it empty, or write ?, where it "
                      "is not known",
                      text::quoted(field), column));
    }
    if (starred) note_inferred(column, value);
    return value;
  }

  void note_inferred(const std::string& column, double value) {
    const std::string sentence =
        fmt::format("{} {:g} is marked in the file as inferred, not printed", column, value);
    if (std::find(inferred_.begin(), inferred_.end(), sentence) == inferred_.end()) {
      inferred_.push_back(sentence);
    }
  }

  std::string list_of_names() const {
    constexpr std::size_t most = 20;
    const auto last = names_.begin() + static_cast<std::ptrdiff_t>(std::min(most, names_.size()));
    return fmt::format("{}{}", fmt::join(names_.begin(), last, ", "),
                       names_.size() > most ? ", ..." : "");
  }

  /// More fabrics than one and none was named: reads on to tell all names.
  [[noreturn]] void throw_many() {
    for (Fields fields; rows_.next(fields);) names_.emplace_back(fields[0]);
    throw InvalidInput(fmt::format("{}: holds {} fabrics: {}; choose one as '{}:NAME'", source_,
                                   names_.size(), list_of_names(), source_));
  }

  [[noreturn]] void throw_none() const {
    throw InvalidInput(
        names_.empty()
            ? fmt::format(
                  "{}: holds no fabric; a line of columns and then one line per fabric were "
                  "expected (docs/formats/fabric.md)",
                  source_)
            : fmt::format("{}: holds no fabric {}; it has {}", source_, text::quoted(wanted_),
                          list_of_names()));
  }

  CsvRows rows_;
  std::string source_, wanted_, place_;
  Fields columns_;
  std::vector<std::string> names_, inferred_;
  std::optional<KesFigures> chosen_;
};

}  // namespace

FabricRecord parse_fabric_figures(std::string_view content, const std::string& source,
                                  const std::string& name) {
  return FiguresParser(content, source, name).parse();
}

}  // namespace semblance
