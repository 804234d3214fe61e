#include "semblance/cloth/fabric_io.h"

#include <gmock/gmock.h>

#include <cmath>
#include <fstream>
#include <functional>

#include "plausible_fabric.h"
#include "semblance/core/errors.h"
#include "semblance/io/text.h"
#include "support.h"

namespace semblance {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using testing::plausible_fabric;
using ::testing::StartsWith;

class FabricFiles : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }
  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(path(name), std::ios::binary) << text;
    return path(name);
  }
  /// What reading says; "nothing" where it succeeds.
  static std::string problem_of(const std::function<void()>& action) {
    try {
      action();
    } catch (const InvalidInput& error) {
      return error.what();
    }
    return "nothing";
  }
  std::string problem(const std::string& name, const std::string& text,
                      const std::string& fabric = "") const {
    const std::string file = write(name, text);
    return problem_of([&] { read_fabric(file, fabric); });
  }

 private:
  testing::TemporaryFolder folder_;
};

/// All modes but weft as lines, in KES units; `more` is put before the end.
std::string json(const std::string& more, const std::string& units = "kes") {
  return R"({"schema": "semblance.fabric/1", "name": "cotton", "units": ")" + units + "\"" +
         (more.empty() ? "" : ", " + more) + "}";
}

TEST_F(FabricFiles, JsonComesBackToTheLastBit) {
  Fabric fabric = plausible_fabric();
  fabric.name = "with \"quotes\" and \u00e4";
  fabric.area_density_kg_m2 = 0.1 + 0.2 / 3.0;
  fabric.shear.elastic = Curve({0.0, 0.1 / 3.0, 0.14}, {0.0, 2.0 / 3.0, 8.1});
  fabric.shear.viscosity_s = 1.0 / 7.0;
  fabric.bending_bias = linear_response(0.9e-5, 250.0, 1e-4 / 3.0);
  fabric.assumptions = {"one\nline", "two"};
  write_fabric(path("a.json"), fabric);
  EXPECT_EQ(read_fabric(path("a.json")), fabric);
}

TEST_F(FabricFiles, FabricsOfFiguresComeBackToo) {
  const Fabric fabric = fabric_from_figures({}, "test");
  write_fabric(path("a.json"), fabric);
  EXPECT_EQ(read_fabric(path("a.json")), fabric);
}

TEST_F(FabricFiles, JsonInKesUnits) {
  const std::string file =
      write("a.json",
            json(R"("area_density": 120, "thickness": 0.3, "friction": 0.25, "mass_damping_1_s": 0,
              "tension_warp": {"stiffness": 100},
              "shear": {"elastic": [[0, 0], [4, 4], [8, 10]], "friction": [[0, 1], [8, 1.5]],
                        "reversal": 0.4, "viscosity_s": 0.01},
              "bending_warp": {"stiffness": 0.1, "friction": 0.03, "end": 2},
              "bending_weft": {"loading": [[0, 0], [0.1, 0.03], [1, 0.12], [2, 0.22]],
                               "unloading": [[2, 0.22], [1.8, 0.16], [1, 0.08], [0, -0.02]]})"));
  const FabricRecord record = read_fabric_record(file);
  const Fabric& fabric = record.fabric;
  EXPECT_DOUBLE_EQ(fabric.area_density_kg_m2, 0.12);
  EXPECT_DOUBLE_EQ(fabric.thickness_m, 3e-4);
  EXPECT_EQ(fabric.friction, 0.25);
  EXPECT_EQ(fabric.mass_damping_1_s, 0.0);
  EXPECT_NEAR(fabric.tension[warp].elastic.value(0.05), 500.0 * 0.980665, 1e-9);
  EXPECT_EQ(fabric.tension[weft], fabric.tension[warp]);
  EXPECT_NEAR(fabric.shear.elastic.value(8.0 * kes::rad_from_deg), 9.80665, 1e-12);
  EXPECT_NEAR(fabric.shear.reversal, 0.4 * kes::rad_from_deg, 1e-15);
  EXPECT_EQ(fabric.shear.viscosity_s, 0.01);
  EXPECT_NEAR(fabric.bending[warp].elastic.value(100.0), 9.80665e-4, 1e-12);
  EXPECT_NEAR(fabric.bending[warp].elastic.last(), 200.0, 1e-9);
  EXPECT_NEAR(fabric.bending[weft].elastic.value(100.0), 0.1 * 9.80665e-3, 1e-9);
  EXPECT_NEAR(fabric.bending[weft].friction.value(100.0), 0.02 * 9.80665e-3, 1e-9);
  EXPECT_EQ(record.measured.bending[weft].size(), 8u);
  EXPECT_TRUE(record.measured.shear.empty());
  // 20 gf/cm in 2 deg would be the steepest; the given figures are those of the curves.
  EXPECT_NEAR(*record.given.bending[warp].b_gf_cm2_cm, 0.1, 1e-9);
  EXPECT_FALSE(record.given.tension[weft].emt_pct);
  EXPECT_THAT(fabric.assumptions, Contains(HasSubstr("tension_weft not given")));
}

TEST_F(FabricFiles, JsonMessagesNameTheKeyAndTheRemedy) {
  EXPECT_THAT(problem("a.json", "{"), HasSubstr("a.json"));
  EXPECT_THAT(problem("a.json", "[]"), HasSubstr("object"));
  EXPECT_THAT(problem("a.json", "{}"), HasSubstr("semblance.fabric/1"));
  EXPECT_THAT(problem("a.json", json("", "imperial")), HasSubstr("one of kes, si"));
  EXPECT_THAT(problem("a.json", json(R"("area_densty": 1)")), HasSubstr("area_densty"));
  EXPECT_THAT(problem("a.json", json(R"("area_density": 0)")), HasSubstr("leave it out"));
  EXPECT_THAT(problem("a.json", json(R"("area_density": 120)", "si")), HasSubstr("g/m2?"));
  EXPECT_THAT(problem("a.json", json(R"("shear": {})")),
              AllOf(HasSubstr("shear"), HasSubstr("'stiffness'")));
  EXPECT_THAT(problem("a.json", json(R"("shear": {"stiffness": 1, "elastic": []})")),
              HasSubstr("one of"));
  EXPECT_THAT(problem("a.json", json(R"("shear": {"elastic": [[0, 0], [1, 1]]})")),
              HasSubstr("shear.friction"));
  EXPECT_THAT(
      problem("a.json", json(R"("shear": {"elastic": [[0, 0], [0, 1]], "friction": [[0, 0]]})")),
      AllOf(HasSubstr("shear.elastic"), HasSubstr("increase")));
  EXPECT_THAT(problem("a.json", json(R"("shear": {"loading": [[0, 0], [8, "x"]]})")),
              HasSubstr("shear.loading"));
  EXPECT_THAT(problem("a.json", json(R"("shear": {"loading": [[0, 0], [8, 8]],
                                                   "unloading": [[0, 0], [7, 6]]})")),
              HasSubstr("shear: loading ends at"));
  EXPECT_THAT(problem("a.json", json(R"("bending_warp": {"stiffness": 0.1},
                                        "bending_bias": {"stiffness": 0.04})")),
              HasSubstr("too weak to be possible"));
  EXPECT_EQ(problem("a.json", json("")), "nothing");
}

TEST_F(FabricFiles, WritingRefusesOtherNames) {
  EXPECT_THAT(problem_of([&] { write_fabric(path("a.txt"), plausible_fabric()); }),
              HasSubstr(".json"));
  EXPECT_FALSE(fs::exists(path("a.txt")));
  EXPECT_THAT(problem("a.yaml", ""), HasSubstr(".json or .csv"));
  EXPECT_THROW(read_fabric(path("absent.csv")), IoError);
}

const char* const columns = "mode,branch,deformation,deformation_unit,force,force_unit\n";

TEST_F(FabricFiles, CurvesInMixedUnits) {
  const std::string file = write("a.csv", std::string("# a fabric\nname,twill\n\n"
                                                      "area_density,200,g/m2\r\n"
                                                      "thickness,0.0005,m\nfriction,0.4\n"
                                                      "mass_damping,0.2,1/s\n") +
                                              columns +
                                              "shear,loading,0,deg,0,gf/cm\n"
                                              "shear, loading, 4, deg, 5, gf/cm\n"
                                              "shear,loading,0.1396263401595464,rad,9,gf/cm\n"
                                              "shear,unloading,8,deg,9,gf/cm\n"
                                              "shear,unloading,7,deg,6,gf/cm\n"
                                              "shear,unloading,4,deg,3,gf/cm\n"
                                              "shear,unloading,0,deg,-1,gf/cm\n");
  const Fabric fabric = read_fabric(file);
  EXPECT_EQ(fabric.name, "twill");
  EXPECT_DOUBLE_EQ(fabric.area_density_kg_m2, 0.2);
  EXPECT_DOUBLE_EQ(fabric.thickness_m, 5e-4);
  EXPECT_EQ(fabric.friction, 0.4);
  EXPECT_EQ(fabric.mass_damping_1_s, 0.2);
  EXPECT_NEAR(fabric.shear.elastic.value(4.0 * kes::rad_from_deg), 4.0 * 0.980665, 1e-9);
  EXPECT_NEAR(fabric.shear.friction.value(4.0 * kes::rad_from_deg), 0.980665, 1e-9);
  EXPECT_THAT(fabric.assumptions, Contains(HasSubstr("bending not given")));
}

TEST_F(FabricFiles, RecordedLoopsReadAsCurvesGiveTheSameFigures) {
  KesFigures figures;
  figures.tension[warp] = {6.0, 0.65, std::nullopt, 55.0};
  figures.shear = {1.2, 1.5, 3.0};
  figures.bending = {{{0.12, 0.05}, {0.08, 0.03}}};
  const Fabric fabric = fabric_from_figures(figures, "test");
  write_loops(path("loops.csv"), "again,\"", run_kes_tests(material_points(fabric), {400}));
  const FabricRecord record = read_fabric_record(path("loops.csv"));
  EXPECT_EQ(record.fabric.name, "again");  // what CSV cannot hold is left out
  const KesFigures again = figures_of(run_kes_tests(material_points(record.fabric)));
  const KesFigures first = figures_of(run_kes_tests(material_points(fabric)));
  for (const FigureComparison& comparison : compare_figures(first, again)) {
    EXPECT_NEAR(*comparison.residual_pct(), 0.0, 0.5) << comparison.name.symbol;
  }
  for (const FigureComparison& comparison : compare_figures(first, record.given)) {
    EXPECT_NEAR(*comparison.residual_pct(), 0.0, 0.5) << comparison.name.symbol;
  }
}

TEST_F(FabricFiles, CurveMessagesNameTheLineAndTheRemedy) {
  const auto curves = [&](const std::string& rows) { return problem("a.csv", columns + rows); };
  EXPECT_THAT(problem("a.csv", ""), HasSubstr("is empty"));
  EXPECT_THAT(problem("a.csv", "name,x\n"), HasSubstr("no line 'mode,branch"));
  EXPECT_THAT(problem("a.csv", "weight,3\n"), AllOf(HasSubstr("a.csv:1"), HasSubstr("weight")));
  EXPECT_THAT(problem("a.csv", "thickness,3,in\n"), HasSubstr("'m' or 'mm'"));
  EXPECT_THAT(problem("a.csv", "thickness,0,mm\n"), HasSubstr("leave the line out"));
  EXPECT_THAT(problem("a.csv", "mode,force\n"), HasSubstr("columns must be"));
  EXPECT_THAT(curves("shear,loading,1,deg\n"), HasSubstr("a.csv:2: 4 fields"));
  EXPECT_THAT(curves("sheer,loading,1,deg,2,gf/cm\n"), HasSubstr("tension_warp, tension_weft"));
  EXPECT_THAT(curves("shear,up,1,deg,2,gf/cm\n"), HasSubstr("loading, unloading"));
  EXPECT_THAT(curves("shear,loading,1,%,2,gf/cm\n"), HasSubstr("'rad' or 'deg'"));
  EXPECT_THAT(curves("shear,loading,x,deg,2,gf/cm\n"), HasSubstr("'x' is not a number"));
  EXPECT_THAT(curves("shear,loading,nan,deg,2,gf/cm\n"), HasSubstr("not a number"));
  EXPECT_THAT(curves("shear,loading,-1,deg,2,gf/cm\n"), HasSubstr("reverse_loading"));
  EXPECT_THAT(curves("shear,unloading,1,deg,2,gf/cm\n"), HasSubstr("no rows of branch 'loading'"));
  EXPECT_THAT(curves("shear,loading,1,deg,2,gf/cm\nshear,loading,1,deg,2,gf/cm\n"),
              HasSubstr("a.csv:3: the same deformation"));
  EXPECT_THAT(curves("shear,loading,0,deg,0,gf/cm\nshear,loading,8,deg,9,gf/cm\n"
                     "shear,reverse_loading,-8,deg,-9,gf/cm\n"),
              HasSubstr("both or none"));
  EXPECT_THAT(curves("tension_warp,reverse_loading,-8,%,-9,gf/cm\n"), HasSubstr("no reverse"));
  EXPECT_THAT(curves("\"shear\",loading,1,deg,2,gf/cm\n"), HasSubstr("quotes"));
  EXPECT_THAT(curves(std::string(5000, 'x')), HasSubstr("longer than"));
  EXPECT_THAT(problem("a.csv", "name,caf\xe9\n"), HasSubstr("a.csv:1: is not UTF-8"));
  EXPECT_THAT(problem("a.csv", "fabric,LT\ncaf\xc3\xa9,0.7\n"), HasSubstr("nothing"));
}

const std::string figures_columns = "fabric,source,EMT_pct,LT,B_gfcm2_cm_warp,B_gfcm2_cm_weft\n";

TEST_F(FabricFiles, FiguresByName) {
  const std::string file =
      write("a.csv", figures_columns + "one,book,5,0.7,0.1,0.08\n# comment\ntwo,,4*,?,,0.05\n");
  const FabricRecord one = read_fabric_record(file, "one"), two = read_fabric_record(file + ":two");
  EXPECT_EQ(one.given.source, "book");
  EXPECT_EQ(one.given.bending[warp].b_gf_cm2_cm, 0.1);
  EXPECT_EQ(one.given.bending[weft].b_gf_cm2_cm, 0.08);
  EXPECT_TRUE(one.given.mean_of_directions);
  EXPECT_EQ(two.given.tension[weft].emt_pct, 4.0);
  EXPECT_FALSE(two.given.tension[warp].lt);
  EXPECT_THAT(two.fabric.assumptions, Contains(HasSubstr("marked in the file as inferred")));
  EXPECT_THAT(two.fabric.assumptions, Contains(HasSubstr("bending along warp not given")));
}

TEST_F(FabricFiles, FiguresMessagesNameTheLineAndTheRemedy) {
  const std::string rows = "one,,5,0.7,0.1,0.08\ntwo,,4,?,,0.05\n";
  EXPECT_THAT(problem("a.csv", figures_columns + rows),
              AllOf(HasSubstr("holds 2 fabrics: one, two"), HasSubstr(":NAME'")));
  EXPECT_THAT(problem("a.csv", figures_columns + rows, "three"),
              HasSubstr("no fabric 'three'; it has one, two"));
  EXPECT_THAT(problem("a.csv", figures_columns), HasSubstr("holds no fabric"));
  EXPECT_THAT(problem("a.csv", "fabric,EMT\n"), HasSubstr("'EMT' is not known; known are"));
  EXPECT_THAT(problem("a.csv", "fabric,LT,LT\n"), HasSubstr("twice"));
  EXPECT_THAT(problem("a.csv", "fabric,LT\none\n"), HasSubstr("a.csv:2: 1 fields"));
  EXPECT_THAT(problem("a.csv", "fabric,LT\none,high\n"), HasSubstr("'high' in column LT"));
  EXPECT_THAT(problem("a.csv", "fabric,LT\none,7\n"), HasSubstr("a.csv:2: one: LT warp is 7"));
  EXPECT_THAT(problem("a.csv", "fabric,LT\none,0.7\none,0.7\n", "one"), HasSubstr("twice"));
  EXPECT_THAT(problem("a.csv", "fabric,LT,LT_warp\none,0.7,0.7\n"), HasSubstr("with and without"));
  EXPECT_THAT(problem("a.csv", "fabric,weight_g_m2\none,0\n"), HasSubstr("must be positive"));
}

TEST_F(FabricFiles, OneFabricNeedsNoNameAndAcceptsItsOwn) {
  EXPECT_EQ(problem("a.csv", "fabric,LT\none,0.7\n"), "nothing");
  EXPECT_EQ(problem("a.json", json(""), "cotton"), "nothing");
  EXPECT_THAT(problem("a.json", json(""), "silk"), HasSubstr("the one fabric 'cotton'"));
}

// What the page shows must work: each fenced block of docs/formats/fabric.md is read.
TEST_F(FabricFiles, ExamplesOfTheDocumentation) {
  std::ifstream page(SEMBLANCE_FABRIC_PAGE);
  std::string block, kind;
  int examples = 0;
  for (std::string line; std::getline(page, line);) {
    if (!line.starts_with("```")) {
      block += line + "\n";
      continue;
    }
    if (kind.empty()) {
      kind = line.substr(3);
      kind += kind.empty() ? "text" : "";
      block.clear();
      continue;
    }
    if (kind == "json" || kind == "csv") {
      ++examples;
      const std::string name = block.find("denim A") != std::string::npos ? "denim A" : "";
      EXPECT_EQ(problem("a." + kind, block, name), "nothing") << block;
    }
    kind.clear();
  }
  EXPECT_EQ(examples, 4);
}

}  // namespace
}  // namespace semblance
