// `semblance fabric`: what a file says of a fabric, and the KES tests on a virtual specimen of it.
#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "semblance/cloth/fabric_io.h"
#include "semblance/cloth/loop_drawing.h"
#include "semblance/cloth/sheet_specimen.h"

namespace semblance::cli {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct FabricOptions {
  std::string file, name, folder;
};

std::string figure_name(const FigureComparison& figure) {
  return *figure.name.direction == 0
             ? figure.name.symbol
             : fmt::format("{} {}", figure.name.symbol, figure.name.direction);
}

/// Without the sign of a zero.
std::string residual_text(double residual_pct) {
  return fmt::format("{:.2f}", std::abs(residual_pct) < 0.005 ? 0.0 : residual_pct);
}

void print_figures(const std::vector<FigureComparison>& figures) {
  fmt::print("{:<11}{:<14}{:>10}{:>12}{:>12}\n", "figure", "unit", "given", "reproduced",
             "residual %");
  for (const FigureComparison& figure : figures) {
    const auto residual = figure.residual_pct();
    fmt::print("{:<11}{:<14}{:>10}{:>12}{:>12}\n", figure_name(figure), figure.name.unit,
               figure.given ? figure_text(*figure.given) : "-", figure_text(figure.reproduced),
               residual ? residual_text(*residual) : "-");
  }
}

void print_assumptions(const Fabric& fabric) {
  if (fabric.assumptions.empty()) return;
  fmt::print("\nassumed:\n");
  for (const std::string& sentence : fabric.assumptions) fmt::print("  {}\n", sentence);
}

Json figures_json(const std::vector<FigureComparison>& figures) {
  const auto or_null = [](const std::optional<double>& value) {
    return value ? Json(*value) : Json(nullptr);
  };
  Json list = Json::array();
  for (const FigureComparison& figure : figures) {
    list.push_back({{"figure", figure.name.symbol},
                    {"direction", figure.name.direction},
                    {"unit", figure.name.unit},
                    {"given", or_null(figure.given)},
                    {"reproduced", figure.reproduced},
                    {"residual_pct", or_null(figure.residual_pct())}});
  }
  return list;
}

/// Null where no figure was given.
Json largest_residual(const std::vector<FigureComparison>& figures) {
  std::optional<double> largest;
  for (const FigureComparison& figure : figures) {
    const auto residual = figure.residual_pct();
    if (residual) largest = std::max(largest.value_or(0.0), std::abs(*residual));
  }
  return largest ? Json(*largest) : Json(nullptr);
}

std::string given_label(const FabricOptions& options, const FabricRecord& record) {
  const KesLoops& measured = record.measured;
  const bool any = !measured.shear.empty() || !measured.tension[warp].empty() ||
                   !measured.tension[weft].empty() || !measured.bending[warp].empty() ||
                   !measured.bending[weft].empty();
  if (any) return "measured";
  return options.file.ends_with(".json") ? "given curves" : "curves that have the given figures";
}

void run_test(const Context& context, const FabricOptions& options) {
  const FabricRecord record = read_fabric_record(options.file, options.name);
  const Fabric& fabric = record.fabric;
  const KesLoops loops = run_kes_tests(sheet_specimens(fabric));
  const auto figures = compare_figures(record.given, figures_of(loops));
  LoopDrawing drawing;
  drawing.title = fabric.name.empty() ? "KES tests" : "KES tests: " + fabric.name;
  drawing.subtitle = fmt::format("{:.0f} g/m\u00b2, {:.2f} mm. Virtual specimen: a material point.",
                                 fabric.area_density_kg_m2 / kes::kg_m2_from_g_m2,
                                 fabric.thickness_m / kes::m_from_mm);
  drawing.given_label = given_label(options, record);
  drawing.tested_label = "virtual test";
  drawing.given = record.loops;
  drawing.readings = record.measured;
  drawing.tested = loops;
  drawing.figures = figures;
  make_folder(options.folder);
  const fs::path folder = options.folder;
  write_loops_svg((folder / "loops.svg").string(), drawing);
  write_loops((folder / "loops.csv").string(), fabric.name, loops);
  write_fabric((folder / "fabric.json").string(), fabric);
  print_figures(figures);
  print_assumptions(fabric);
  write_summary(context, Json{{"fabric", fabric.name},
                              {"specimen", "material point"},
                              {"figures", figures_json(figures)},
                              {"largest_residual_pct", largest_residual(figures)},
                              {"assumptions", fabric.assumptions}}
                             .dump(2));
}

void print_property(const char* what, double si, const char* si_unit, double in_kes,
                    const char* kes_unit) {
  fmt::print("{:<30}{:>12.5g} {:<12}{:>12.5g} {}\n", what, si, si_unit, in_kes, kes_unit);
}

/// Mean stiffness over the measured range, and friction at its end.
void print_mode(const std::string& mode, const ModeResponse& response, double stiffness_unit,
                double force_unit, const char* const (&units)[4]) {
  const double end = response.elastic.last();
  const double stiffness = response.elastic.value(end) / end;
  const double friction = response.friction.largest_value();
  print_property((mode + ": mean stiffness").c_str(), stiffness, units[0],
                 stiffness / stiffness_unit, units[1]);
  print_property((mode + ": most friction").c_str(), friction, units[2], friction / force_unit,
                 units[3]);
}

void run_show(const FabricOptions& options) {
  const FabricRecord record = read_fabric_record(options.file, options.name);
  const Fabric& fabric = record.fabric;
  fmt::print("{}\n\n", fabric.name.empty() ? "(no name)" : fabric.name);
  print_property("area density", fabric.area_density_kg_m2, "kg/m2",
                 fabric.area_density_kg_m2 / kes::kg_m2_from_g_m2, "g/m2");
  print_property("thickness", fabric.thickness_m, "m", fabric.thickness_m / kes::m_from_mm, "mm");
  fmt::print("{:<30}{:>12.5g}\n", "coefficient of friction", fabric.friction);
  fmt::print("{:<30}{:>12.5g} 1/s\n", "mass damping", fabric.mass_damping_1_s);
  constexpr const char* pull[] = {"N/m", "gf/cm per %", "N/m", "gf/cm"};
  constexpr const char* shear[] = {"N/m per rad", "gf/(cm deg)", "N/m", "gf/cm"};
  constexpr const char* bend[] = {"N m", "gf cm2/cm", "N", "gf cm/cm"};
  constexpr const char* direction[] = {"warp", "weft"};
  for (const std::size_t d : {warp, weft}) {
    print_mode(fmt::format("tension {}", direction[d]), fabric.tension[d],
               kes::n_m_from_gf_cm / kes::strain_from_pct, kes::n_m_from_gf_cm, pull);
  }
  print_mode("shear", fabric.shear, kes::n_m_rad_from_gf_cm_deg, kes::n_m_from_gf_cm, shear);
  for (const std::size_t d : {warp, weft}) {
    print_mode(fmt::format("bending {}", direction[d]), fabric.bending[d], kes::n_m_from_gf_cm2_cm,
               kes::n_from_gf_cm_cm, bend);
  }
  print_mode("twist", twist_response(fabric), kes::n_m_from_gf_cm2_cm, kes::n_from_gf_cm_cm, bend);
  fmt::print("\n");
  for_each_figure(record.given, [](const FigureName& name, const KesFigures::Figure& figure) {
    if (!figure) return;
    fmt::print("{:<6}{:<6}{:>10} {}\n", name.symbol, name.direction, figure_text(*figure),
               name.unit);
  });
  print_assumptions(fabric);
}

CLI::App* add_subcommand(CLI::App& fabric, const std::shared_ptr<FabricOptions>& options,
                         const char* name, const char* what) {
  CLI::App* command = fabric.add_subcommand(name, what);
  command
      ->add_option("fabric", options->file,
                   "Fabric: .json, .csv, or .csv:NAME (docs/formats/fabric.md)")
      ->required();
  command->add_option("--name", options->name, "Which fabric of a file of many");
  return command;
}

}  // namespace

void add_fabric_commands(CLI::App& app, Context& context) {
  CLI::App* fabric = app.add_subcommand("fabric", "Fabrics: their properties and their tests");
  fabric->require_subcommand(1);
  auto options = std::make_shared<FabricOptions>();
  CLI::App* show = add_subcommand(*fabric, options, "show",
                                  "What a file says, in SI and KES, and what is assumed");
  show->callback([&context, options] { context.action = [options] { run_show(*options); }; });
  auto test_options = std::make_shared<FabricOptions>();
  CLI::App* test =
      add_subcommand(*fabric, test_options, "test",
                     "Tension, shear and bending as KES does them, on a virtual specimen");
  test->add_option("-o,--output", test_options->folder,
                   "Folder for loops.svg, loops.csv, fabric.json")
      ->required();
  test->callback([&context, test_options] {
    context.action = [&context, test_options] { run_test(context, *test_options); };
  });
}

}  // namespace semblance::cli
