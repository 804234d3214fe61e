// `semblance simulate`: what it writes, how it goes on, and what it refuses.
#include <gmock/gmock.h>
#include <signal.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "program.h"
#include "semblance/io/image_io.h"
#include "semblance/io/mesh_io.h"
#include "support.h"

namespace semblance::testing {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::HasSubstr;

class SimulateCommand : public ::testing::Test {
 protected:
  SimulateCommand() {
    write("cotton.json", R"({"schema": "semblance.fabric/1", "name": "cotton", "units": "kes",
      "area_density": 115, "thickness": 0.31, "friction": 0.3, "mass_damping_1_s": 2.0,
      "tension_warp": {"stiffness": 100}, "tension_weft": {"stiffness": 80},
      "shear": {"stiffness": 0.8, "end": 8}, "bending_warp": {"stiffness": 0.1, "end": 2.5},
      "bending_weft": {"stiffness": 0.08, "end": 2.5}})");
  }
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(path(name), std::ios::binary) << text;
  }
  ProgramResult run(const std::string& scene, const std::string& out,
                    std::vector<std::string> more = {}) const {
    std::vector<std::string> arguments = {
        "simulate",         scene, "-o", path(out), "--fabric", path("cotton.json"), "--json",
        path(out + ".json")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_program(arguments);
  }
  json summary(const std::string& out) const {
    return json::parse(file_bytes(path(out + ".json")));
  }
  void expect_refused(const ProgramResult& result, const std::string& message) const {
    EXPECT_EQ(result.exit_code, 3) << result.output;
    EXPECT_THAT(result.output, HasSubstr(message));
    EXPECT_FALSE(fs::exists(path("out")));
  }

 private:
  TemporaryFolder folder_;
};

TEST_F(SimulateCommand, WritesAllItsFiles) {
  const ProgramResult result =
      run("disc", "out", {"--spacing", "0.03", "--method", "quasistatic", "--format", "ply"});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  const json figures = summary("out");
  for (const char* key : {"cpu_s", "wall_s", "simulated_s", "steps", "newton_iterations",
                          "linear_iterations", "collision_share", "residual_n", "relative_residual",
                          "max_edge_strain", "penetrations", "drape_coefficient", "vertices",
                          "at_rest", "method", "spacing_m", "fabric", "assumptions", "levels"}) {
    EXPECT_TRUE(figures.contains(key)) << key;
  }
  EXPECT_EQ(figures["fabric"], "cotton");
  EXPECT_TRUE(figures["simulated_s"].is_null());
  EXPECT_TRUE(figures["at_rest"].get<bool>());
  EXPECT_GT(figures["drape_coefficient"].get<double>(), 0.2);
  EXPECT_LT(figures["drape_coefficient"].get<double>(), 1.0);
  EXPECT_EQ(read_mesh(path("out/rest.obj")).vertex_count(), figures["vertices"].get<int>());
  EXPECT_EQ(read_mesh(path("out/frames/frame-00000.ply")).vertex_count(),
            figures["vertices"].get<int>());
  EXPECT_EQ(read_image(path("out/drape.png")).width, 1000);
  EXPECT_GT(read_image(path("out/compression.png")).width, 800);
  for (const auto& [file, header] : {std::pair{"energy.csv", "level,time_s,step_s,kinetic_j"},
                                     std::pair{"strain.csv", "direction,vertex_1"},
                                     std::pair{"profile.csv", "angle_deg,radius_m"}}) {
    EXPECT_THAT(file_bytes(path(std::string("out/") + file)), HasSubstr(header));
  }
  EXPECT_FALSE(fs::exists(path("out/checkpoint.bin")));
  for (const auto& entry : fs::recursive_directory_iterator(path("out"))) {
    EXPECT_EQ(entry.path().filename().string().find("tmp"), std::string::npos) << entry.path();
  }
}

/// The first drape is the one that is made alone; the figure is the mean of all.
TEST_F(SimulateCommand, DrapesFromSeveralStarts) {
  const std::vector<std::string> options = {"--spacing",   "0.02",     "--method",
                                            "quasistatic", "--format", "none"};
  ASSERT_EQ(run("disc", "one", options).exit_code, 0);
  EXPECT_TRUE(summary("one")["drape_coefficient_deviation"].is_null());
  std::vector<std::string> thrice = options;
  thrice.insert(thrice.end(), {"--drapes", "3"});
  const ProgramResult result = run("disc", "three", thrice);
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output, HasSubstr("mean of 3 drapes"));
  const json figures = summary("three");
  ASSERT_EQ(figures["drapes"].size(), 3u);
  EXPECT_EQ(figures["drapes"][0]["drape_coefficient"], summary("one")["drape_coefficient"]);
  EXPECT_EQ(file_bytes(path("one/rest.obj")), file_bytes(path("three/rest.obj")));
  double sum = 0.0, squares = 0.0;
  for (const json& drape : figures["drapes"]) {
    const double value = drape["drape_coefficient"].get<double>();
    sum += value;
    squares += value * value;
  }
  EXPECT_NEAR(figures["drape_coefficient"].get<double>(), sum / 3.0, 1e-12);
  EXPECT_NEAR(std::pow(figures["drape_coefficient_deviation"].get<double>(), 2),
              (squares - sum * sum / 3.0) / 2.0, 1e-9);
  expect_refused(run("table", "out", {"--drapes", "2"}), "--drapes is for drape tests");
}

TEST_F(SimulateCommand, AnimationsAreOneFile) {
  const ProgramResult result =
      run("pinned", "out", {"--spacing", "0.2", "--until", "0.2", "--format", "glb"});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(file_bytes(path("out/motion.glb")), HasSubstr("\"frame 5\""));
  EXPECT_FALSE(fs::exists(path("out/frames")));
  EXPECT_EQ(summary("out")["frames"], 6);
}

TEST_F(SimulateCommand, ComparesWithAnotherRun) {
  ASSERT_EQ(run("strip", "a", {"--spacing", "0.01", "--method", "quasistatic"}).exit_code, 0);
  ASSERT_EQ(run("strip", "b",
                {"--spacing", "0.005", "--method", "coarse-to-fine", "--compare-with", path("a")})
                .exit_code,
            0);
  EXPECT_LT(summary("b")["shape_error_m"].get<double>(), 0.02);
  EXPECT_EQ(summary("b")["levels"].size(), 2u);
  EXPECT_TRUE(fs::exists(path("b/level-1.obj")));
}

/// What is at rest stays where it is; another piece of fabric is no start.
TEST_F(SimulateCommand, StartsFromAnotherRun) {
  const std::vector<std::string> options = {"--spacing", "0.01", "--method", "quasistatic"};
  ASSERT_EQ(run("strip", "a", options).exit_code, 0);
  std::vector<std::string> again = options;
  again.insert(again.end(), {"--start-from", path("a"), "--compare-with", path("a")});
  ASSERT_EQ(run("strip", "b", again).exit_code, 0);
  EXPECT_LT(summary("b")["shape_error_m"].get<double>(), 1e-4);
  EXPECT_LT(4 * summary("b")["newton_iterations"].get<int>(),
            summary("a")["newton_iterations"].get<int>());
  expect_refused(
      run("table", "out", {"--spacing", "0.05", "--start-from", path("a")}),
      "a/rest.obj: a piece of 0.210 x 0.020 m, and the scene's sheet has 1.000 x 0.800 m");
}

/// Much of a sheet on a table is held by friction, which a shape alone does not show.
TEST_F(SimulateCommand, StartsWithTheFrictionOfTheOtherRun) {
  const std::vector<std::string> options = {"--spacing", "0.04", "--method", "quasistatic"};
  ASSERT_EQ(run("table", "a", options).exit_code, 0);
  std::vector<std::string> again = options;
  again.insert(again.end(), {"--start-from", path("a")});
  ASSERT_EQ(run("table", "b", again).exit_code, 0);
  EXPECT_LE(summary("b")["newton_iterations"].get<int>(), 1);
  fs::remove(path("a/rest.bin"));
  ASSERT_EQ(run("table", "c", again).exit_code, 0);
  EXPECT_GT(summary("c")["newton_iterations"].get<int>(), 3);
  write("b/rest.bin", "semblance");
  again.back() = path("b");
  expect_refused(run("table", "out", again), "b/rest.bin");
}

/// Interrupted after a while, wherever that is; what it ends in is the same to the byte.
TEST_F(SimulateCommand, GoesOnAfterAnInterrupt) {
  const std::vector<std::string> options = {"--spacing", "0.05", "--until", "0.8"};
  ASSERT_EQ(run("table", "whole", options).exit_code, 0);
  RunningProgram program({"simulate", "table", "-o", path("parts"), "--fabric", path("cotton.json"),
                          "--spacing", "0.05", "--until", "0.8"});
  ASSERT_TRUE(program.wait_for_lines(path("parts/frames/frame-00003.obj"), 1));
  program.signal(SIGINT);
  EXPECT_EQ(program.wait().exit_code, 0);
  if (fs::exists(path("parts/rest.obj"))) GTEST_SKIP() << "it was done before the interrupt";
  EXPECT_TRUE(fs::exists(path("parts/checkpoint.bin")));
  std::vector<std::string> resumed = options;
  resumed.push_back("--resume");
  const ProgramResult result = run("table", "parts", resumed);
  ASSERT_EQ(result.exit_code, 0) << result.output;
  for (const char* file : {"rest.obj", "energy.csv", "frames/frame-00019.obj"}) {
    EXPECT_EQ(file_bytes(path(std::string("parts/") + file)),
              file_bytes(path(std::string("whole/") + file)))
        << file;
  }
  EXPECT_FALSE(fs::exists(path("parts/checkpoint.bin")));
}

/// A box as an OBJ file, its top at `top_m`.
std::string box_text(double top_m) {
  std::string out;
  for (const double y : {top_m - 0.1, top_m}) {
    for (const auto& [x, z] : {std::pair{-0.1, 0.1}, {0.1, 0.1}, {0.1, -0.1}, {-0.1, -0.1}}) {
      out += "v " + std::to_string(x) + " " + std::to_string(y) + " " + std::to_string(z) + "\n";
    }
  }
  return out + "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
}

/// A sheet held at two sides; a box comes up below it in half a second and lifts its middle.
TEST_F(SimulateCommand, ABodyThatMovesLiftsTheCloth) {
  for (int k = 0; k <= 5; ++k) {
    write("box_" + std::to_string(k) + ".obj", box_text(-0.05 + 0.016 * k));
  }
  write("scene.json", R"({"schema": "semblance.cloth_scene/1",
    "sheet": {"kind": "rectangle", "warp_m": 0.8, "weft_m": 0.4, "spacing_m": 0.05},
    "fixed": [{"u_m": [0, 0]}, {"u_m": [0.8, 0.8]}],
    "obstacles": [{"kind": "mesh_sequence", "name": "lift", "files": "box_#.obj", "fps": 10}]})");
  expect_refused(run(path("scene.json"), "out"), "a body moves");
  const ProgramResult result =
      run(path("scene.json"), "out", {"--until", "0.6", "--format", "none"});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_EQ(summary("out")["penetrations"], 0);
  // Where the box ended: nothing of the cloth above it lies lower, and something rests on it.
  const auto shape = read_mesh(path("out/rest.obj")).positions_m;
  double lowest = 1.0;
  for (Eigen::Index v = 0; v < shape.rows(); ++v) {
    if (std::abs(shape(v, 0)) < 0.09 && std::abs(shape(v, 2)) < 0.09) {
      lowest = std::min(lowest, shape(v, 1));
    }
  }
  EXPECT_GT(lowest, 0.03);
  EXPECT_LT(lowest, 0.035);
}

/// The way of a garment: over a head, down to the shoulders. The body is real, and in metres.
TEST_F(SimulateCommand, RealDataComesDownOnABody) {
  SEMBLANCE_NEED_DATA("cloth/garmentcode/mean_all.obj");
  json scene = {{"schema", "semblance.cloth_scene/1"},
                {"sheet",
                 {{"kind", "rectangle"},
                  {"warp_m", 0.9},
                  {"weft_m", 0.9},
                  {"spacing_m", 0.04},
                  {"placement", {{"translation_m", {0, 1.7215, 0}}}}}},
                {"obstacles",
                 {{{"kind", "mesh"},
                   {"name", "body"},
                   {"file", data_path("cloth/garmentcode/mean_all.obj").string()}}}}};
  write("scene.json", scene.dump());
  const ProgramResult result =
      run(path("scene.json"), "out", {"--method", "coarse-to-fine", "--format", "none"});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_EQ(summary("out")["penetrations"], 0);
  EXPECT_LT(summary("out")["max_edge_strain"].get<double>(), 0.05);
  const auto shape = read_mesh(path("out/rest.obj")).positions_m;
  EXPECT_GT(shape.col(1).maxCoeff(), 1.70);  // lies on the head
  EXPECT_LT(shape.col(1).minCoeff(), 1.35);  // and hangs below the shoulders
}

TEST_F(SimulateCommand, RefusesWhatItCannotUse) {
  expect_refused(run("curtain", "out"), "presets are table, pinned, pinned-box, disc, strip");
  expect_refused(run_program({"simulate", "table", "-o", path("out")}), "--fabric");
  expect_refused(run("table", "out", {"--spacing", "0.9"}), "two spacings");
  expect_refused(run("table", "out", {"--until", "soon"}), "--until");
  expect_refused(run("table", "out", {"--until", "1", "--method", "quasistatic"}), "know no time");
  write("heavy.json", R"({"schema": "semblance.fabric/1", "name": "x", "units": "kes",
    "area_density": -115, "thickness": 0.31, "tension_warp": {"stiffness": 100},
    "tension_weft": {"stiffness": 80}, "shear": {"stiffness": 0.8, "end": 8},
    "bending_warp": {"stiffness": 0.1, "end": 2.5},
    "bending_weft": {"stiffness": 0.08, "end": 2.5}})");
  expect_refused(
      run_program({"simulate", "table", "-o", path("out"), "--fabric", path("heavy.json")}),
      "density");
  write("scene.json", R"({"schema": "semblance.cloth_scene/1",
    "sheet": {"kind": "rectangle", "warp_m": 1, "weft_m": 1, "spacing_m": 0.1},
    "obstacles": [{"kind": "sphere", "name": "ball", "radius_m": 0.2}]})");
  expect_refused(run(path("scene.json"), "out"), "ball");
}

TEST_F(SimulateCommand, RefusesADamagedCheckpoint) {
  fs::create_directory(path("run"));
  write("run/checkpoint.bin", "semblance.cloth_checkpoint/2\n12345678901234567890");
  const ProgramResult result = run("strip", "run", {"--resume"});
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(result.output, HasSubstr("damaged"));
}

TEST_F(SimulateCommand, WrongUsageIsSaidFirst) {
  EXPECT_EQ(run("table", "out", {"--method", "magic"}).exit_code, 2);
  EXPECT_EQ(run("table", "out", {"--step", "-1"}).exit_code, 2);
  EXPECT_EQ(run("table", "out", {"--format", "fbx"}).exit_code, 2);
  EXPECT_FALSE(fs::exists(path("out")));
}

}  // namespace
}  // namespace semblance::testing
