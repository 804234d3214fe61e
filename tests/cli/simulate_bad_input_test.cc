// What `semblance simulate` and `semblance fabric` answer to input that cannot be used: exit code
// 3, a message that names the file or body and says how to mend it, and nothing written.
#include <gmock/gmock.h>
#include <signal.h>

#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <set>

#include "program.h"
#include "support.h"

namespace semblance::testing {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::HasSubstr;

/// Words of an OBJ file, so that tests can write what no mesh can hold.
struct ObjText {
  std::vector<std::array<std::string, 3>> positions;
  std::vector<std::array<std::string, 2>> places;
  std::vector<std::array<int, 3>> triangles;

  std::string text() const {
    std::string out;
    for (const auto& p : positions) out += "v " + p[0] + " " + p[1] + " " + p[2] + "\n";
    for (const auto& p : places) out += "vt " + p[0] + " " + p[1] + "\n";
    for (const auto& t : triangles) {
      out += "f";
      for (const int v : t) {
        const std::string number = std::to_string(v);
        out.append(" ").append(number).append("/").append(number);
      }
      out += "\n";
    }
    return out;
  }
};

/// A square of four quads of 0.1 m.
ObjText square() {
  ObjText out;
  for (int j = 0; j < 3; ++j) {
    for (int i = 0; i < 3; ++i) {
      const std::string u = std::to_string(0.1 * i), v = std::to_string(0.1 * j);
      out.positions.push_back({u, "0", std::to_string(-0.1 * j)});
      out.places.push_back({u, v});
    }
  }
  for (const int corner : {1, 2, 4, 5}) {
    out.triangles.push_back({corner, corner + 1, corner + 4});
    out.triangles.push_back({corner, corner + 4, corner + 3});
  }
  return out;
}

/// Six quads of 0.1 m rolled up so tightly that the last go through the first.
ObjText crossing_roll() {
  ObjText out;
  const std::array<std::array<const char*, 2>, 7> outline{{{"0", "0"},
                                                           {"0.1", "0"},
                                                           {"0.1", "0.1"},
                                                           {"0", "0.1"},
                                                           {"0", "0.01"},
                                                           {"0.05", "-0.07"},
                                                           {"0.15", "-0.07"}}};
  for (int j = 0; j < 2; ++j) {
    for (int i = 0; i < 7; ++i) {
      out.positions.push_back({outline[i][0], outline[i][1], j == 0 ? "0" : "-0.1"});
      out.places.push_back({std::to_string(0.1 * i), j == 0 ? "0" : "0.1"});
    }
  }
  for (int i = 1; i < 7; ++i) {
    out.triangles.push_back({i, i + 1, i + 8});
    out.triangles.push_back({i, i + 8, i + 7});
  }
  return out;
}

json good_fabric() {
  return {{"schema", "semblance.fabric/1"},
          {"name", "cotton"},
          {"units", "si"},
          {"area_density", 0.115},
          {"thickness", 0.00031},
          {"friction", 0.3},
          {"tension_warp", {{"stiffness", 10000.0}}},
          {"tension_weft", {{"stiffness", 8000.0}}},
          {"shear", {{"stiffness", 45.0}, {"end", 0.14}}},
          {"bending_warp", {{"stiffness", 1e-5}, {"end", 250.0}}},
          {"bending_weft", {{"stiffness", 8e-6}, {"end", 250.0}}}};
}

json scene_of(const json& sheet, const json& bodies = json::array()) {
  return {{"schema", "semblance.cloth_scene/1"},
          {"fabric", "cotton.json"},
          {"sheet", sheet},
          {"obstacles", bodies}};
}

json square_sheet() {
  return {{"kind", "rectangle"}, {"warp_m", 0.4}, {"weft_m", 0.4}, {"spacing_m", 0.05}};
}

class ClothInput : public ::testing::Test {
 protected:
  ClothInput() {
    write("cotton.json", good_fabric().dump());
    write("scene.json", scene_of(square_sheet()).dump());
  }
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(path(name), std::ios::binary) << text;
  }
  ProgramResult simulate(const std::string& out, std::vector<std::string> more = {}) const {
    const std::vector<std::string> start{"simulate", path("scene.json"), "-o", path(out)};
    more.insert(more.begin(), start.begin(), start.end());
    return run_program(more);
  }
  std::set<std::string> files() const {
    std::set<std::string> names;
    for (const auto& entry : fs::recursive_directory_iterator(folder_.path())) {
      names.insert(entry.path().string());
    }
    return names;
  }
  void expect_refused(const std::vector<std::string>& arguments,
                      const std::vector<std::string>& says) const {
    const std::set<std::string> before = files();
    const ProgramResult result = run_program(arguments);
    EXPECT_EQ(result.exit_code, 3) << result.output;
    for (const std::string& words : says) EXPECT_THAT(result.output, HasSubstr(words));
    EXPECT_EQ(files(), before);
  }

 private:
  TemporaryFolder folder_;
};

// ---- sheets and bodies

struct BadScene {
  std::string name;
  json scene;
  ObjText mesh;                   // written as part.obj where it has vertices
  std::vector<std::string> says;  // what is wrong, where, and how to mend it
};

class BadScenes : public ClothInput, public ::testing::WithParamInterface<BadScene> {};

TEST_P(BadScenes, AreRefused) {
  write("scene.json", GetParam().scene.dump());
  if (!GetParam().mesh.positions.empty()) write("part.obj", GetParam().mesh.text());
  expect_refused({"simulate", path("scene.json"), "-o", path("out"), "--until", "0.1"},
                 GetParam().says);
}

ObjText with(const std::function<void(ObjText&)>& change) {
  ObjText out = square();
  change(out);
  return out;
}

std::vector<BadScene> bad_scenes() {
  const json mesh = scene_of({{"kind", "mesh"}, {"file", "part.obj"}});
  const json rock = scene_of(
      square_sheet(), {{{"kind", "mesh"}, {"name", "rock"}, {"file", "part.obj"}, {"scale", 2}}});
  const json ball =
      scene_of(square_sheet(), {{{"kind", "sphere"}, {"name", "ball"}, {"radius_m", 0.1}}});
  json near = scene_of(square_sheet(),
                       {{{"kind", "plane"}, {"name", "floor"}, {"point_m", {0, -1e-5, 0}}}});
  near["sheet"]["placement"] = {{"translation_m", {0, -2e-5, 0}}};
  return {
      {"Fin",
       mesh,
       with([](ObjText& m) {
         m.positions.push_back({"0", "0.1", "0"});
         m.places.push_back({"0.0", "0.3"});
         m.triangles.push_back({1, 5, 10});
       }),
       {"part.obj", "triangles 2 and 9", "not a manifold", "remove one, or turn it round"}},
      {"OneTriangleInverted",
       mesh,
       with([](ObjText& m) { std::swap(m.triangles[2][0], m.triangles[2][1]); }),
       {"part.obj", "triangle 3 is inverted", "1 of 8", "mend the texture coordinates"}},
      {"AllInverted",
       mesh,
       with([](ObjText& m) {
         for (auto& t : m.triangles) std::swap(t[0], t[1]);
       }),
       {"part.obj", "8 of 8", "turn the triangles round"}},
      {"NotANumber",
       mesh,
       with([](ObjText& m) { m.positions[4][1] = "nan"; }),
       {"part.obj:5", "'nan' is not a finite number"}},
      {"PlaceNotANumber",
       mesh,
       with([](ObjText& m) { m.places[4][1] = "nan"; }),
       {"part.obj:14", "'nan' is not a finite number"}},
      {"PlacesFromZeroToOne",
       mesh,
       with([](ObjText& m) {
         for (auto& p : m.places) p = {p[0] + "e1", p[1] + "e1"};
       }),
       {"part.obj", "0.1 times as long", "multiply the texture coordinates by 0.1"}},
      {"Millimetres",
       mesh,
       with([](ObjText& m) {
         for (auto& p : m.positions) p = {p[0] + "e3", p[1], p[2] + "e3"};
       }),
       {"part.obj", "1000 times as long", "the positions by 0.001"}},
      {"NoFile", mesh, {}, {"part.obj", "cannot be opened", "from its own folder"}},
      {"CrossesItself",
       mesh,
       crossing_roll(),
       {"scene.json", "the cloth crosses itself", "place the sheet so that it is clear"}},
      {"BodyNotANumber",
       rock,
       with([](ObjText& m) { m.positions[4][1] = "inf"; }),
       {"part.obj:5", "'inf' is not a finite number"}},
      {"BodyWithoutFile", rock, {}, {"part.obj", "cannot be opened", "from its own folder"}},
      {"InABody", ball, {}, {"scene.json", "\"ball\"", "mm deep", "place the sheet"}},
      {"UnderAPlane", near, {}, {"scene.json", "\"floor\"", "place the sheet"}},
  };
}

INSTANTIATE_TEST_SUITE_P(Cloth, BadScenes, ::testing::ValuesIn(bad_scenes()),
                         [](const auto& test) { return test.param.name; });

// ---- fabrics

struct BadFabric {
  std::string name, key;
  json value;
  std::vector<std::string> says;
};

class BadFabrics : public ClothInput, public ::testing::WithParamInterface<BadFabric> {};

TEST_P(BadFabrics, AreRefusedByBothCommands) {
  json fabric = good_fabric();
  fabric[GetParam().key] = GetParam().value;
  write("bad.json", fabric.dump());
  std::vector<std::string> says = GetParam().says;
  says.emplace_back("bad.json");
  expect_refused({"simulate", path("scene.json"), "-o", path("out"), "--fabric", path("bad.json")},
                 says);
  expect_refused({"fabric", "test", path("bad.json"), "-o", path("out")}, says);
}

const json curve_that_falls = {{"elastic", {{0, 0}, {0.01, 30}, {0.02, 20}, {0.05, 500}}},
                               {"friction", {{0, 0}, {0.05, 0}}}};
const json loading_that_falls = {{"loading", {{0, 0}, {0.01, 30}, {0.02, 20}, {0.05, 500}}}};
const json deflection_in_pct = {{"loading", {{0, 0}, {2, 100}, {5, 500}}}};

const BadFabric bad_fabrics[] = {
    {"NegativeDensity", "area_density", -0.115, {"area density: -0.115", "mend the sign"}},
    {"DensityInGrams", "area_density", 115, {"area density: 115", "did you mean g/m2?"}},
    {"DensityTooSmall", "area_density", 1.15e-4, {"area density: 0.000115", "and wrote g/m2?"}},
    {"ThicknessInMillimetres", "thickness", 0.31, {"thickness: 0.31", "did you mean mm?"}},
    {"ThicknessTooSmall", "thickness", 3.1e-7, {"thickness: 3.1e-07", "and wrote m?"}},
    {"TensionTooStiff",
     "tension_weft",
     {{"stiffness", 8e6}},
     {"tension along weft", "8e+06 is not between 50 and 1e+06 N/m", "did you mean"}},
    {"TensionTooSoft",
     "tension_weft",
     {{"stiffness", 8.0}},
     {"tension along weft", "8 is not between 50 and 1e+06 N/m", "did you mean N/cm or kN/m?"}},
    {"StrainInPercent", "tension_warp", deflection_in_pct, {"tension along warp", "mean %?"}},
    {"ShearTooStiff",
     "shear",
     {{"stiffness", 45e3}, {"end", 0.14}},
     {"shear", "45000 is not between", "did you mean"}},
    {"ShearTooSoft",
     "shear",
     {{"stiffness", 0.045}, {"end", 0.14}},
     {"shear", "0.045 is not between", "did you mean"}},
    {"BendingTooStiff",
     "bending_warp",
     {{"stiffness", 1e-2}, {"end", 250}},
     {"bending along warp", "0.01 is not between", "did you mean gf cm2/cm"}},
    {"BendingTooSoft",
     "bending_warp",
     {{"stiffness", 8e-9}, {"end", 250}},
     {"bending along warp", "8e-09 is not between", "did you mean"}},
    {"CurveFalls", "tension_warp", curve_that_falls, {"between 0.01 and 0.02", "leave such"}},
    {"LoadingFalls", "tension_warp", loading_that_falls, {"between 0.01 and 0.02", "leave such"}},
};

INSTANTIATE_TEST_SUITE_P(Cloth, BadFabrics, ::testing::ValuesIn(bad_fabrics),
                         [](const auto& test) { return test.param.name; });

// ---- files and options

TEST_F(ClothInput, MissingFilesAreNamed) {
  expect_refused({"simulate", path("absent.json"), "-o", path("out")}, {"absent.json"});
  expect_refused({"simulate", path("scene.json"), "-o", path("out"), "--fabric", path("no.json")},
                 {"no.json"});
  expect_refused({"simulate", "table", "-o", path("out"), "--fabric", path("no.json")},
                 {"no.json"});
}

/// A file stands where the folder would: that holds for every user, the superuser too.
TEST_F(ClothInput, FoldersThatCannotBeMade) {
  write("taken", "");
  for (const char* folder : {"taken", "taken/inside"}) {
    const std::vector<std::string> says{"taken", "cannot be used as the output folder",
                                        "in a place you can write to"};
    expect_refused({"simulate", path("scene.json"), "-o", path(folder), "--until", "0.1"}, says);
    expect_refused({"fabric", "test", path("cotton.json"), "-o", path(folder)}, says);
  }
}

/// Steps of a second end between two frames, or in halves: warned of, and never in garbage.
TEST_F(ClothInput, StepsThatAreTooLongAreWarnedOf) {
  for (const char* fps : {"25", "1"}) {
    const ProgramResult result = run_program(
        {"simulate", "pinned-box", "-o", path("out"), "--fabric", path("cotton.json"), "--spacing",
         "0.1", "--step", "1", "--until", "2", "--fps", fps, "--json", path("summary.json")});
    ASSERT_EQ(result.exit_code, 0) << result.output;
    EXPECT_THAT(result.output, HasSubstr("warning: steps of 1 s are"));
    const json summary = json::parse(file_bytes(path("summary.json")));
    EXPECT_EQ(summary["penetrations"], 0);
    EXPECT_LT(summary["max_edge_strain"].get<double>(), 0.05);
  }
}

/// Beyond their limit explicit steps explode: that is an error, and no shape is written.
TEST_F(ClothInput, ExplicitStepsThatAreTooLongAreAnError) {
  const ProgramResult result = run_program(
      {"simulate", "pinned-box", "-o", path("out"), "--fabric", path("cotton.json"), "--spacing",
       "0.1", "--scheme", "explicit", "--step", "0.01", "--until", "1", "--format", "none"});
  EXPECT_EQ(result.exit_code, 4) << result.output;
  EXPECT_THAT(result.output, HasSubstr("the implicit scheme may help"));
  EXPECT_FALSE(fs::exists(path("out/rest.obj")));
}

TEST_F(ClothInput, ResumingWithOtherOptionsIsRefused) {
  RunningProgram program(
      {"simulate", path("scene.json"), "-o", path("out"), "--until", "1000", "--fps", "5"});
  ASSERT_TRUE(program.wait_for_lines(path("out/frames/frame-00002.obj"), 1));
  program.signal(SIGINT);
  ASSERT_EQ(program.wait().exit_code, 0);
  const std::string checkpoint = file_bytes(path("out/checkpoint.bin"));
  ASSERT_FALSE(checkpoint.empty());
  const std::vector<std::vector<std::string>> others = {
      {"--step", "0.005"}, {"--spacing", "0.1"}, {"--model", "choi-ko"}, {"--hysteresis", "off"}};
  for (std::vector<std::string> other : others) {
    const std::vector<std::string> start{
        "simulate", path("scene.json"), "-o", path("out"), "--until", "1000", "--fps",
        "5",        "--resume"};
    other.insert(other.begin(), start.begin(), start.end());
    expect_refused(other, {"scene.json", "other options; give those, or start anew"});
    EXPECT_EQ(file_bytes(path("out/checkpoint.bin")), checkpoint);
  }
}

TEST_F(ClothInput, NothingToResumeIsSaid) {
  const ProgramResult result = simulate("out", {"--until", "0.1", "--resume"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.output, HasSubstr("checkpoint.bin: there is no such file to go on from"));
}

}  // namespace
}  // namespace semblance::testing
