// `semblance sweep surface`: what it writes, and what it answers to files that cannot be used.
#include <gmock/gmock.h>

#include <fstream>

#include "program.h"
#include "semblance/io/image_io.h"
#include "semblance/io/mesh_io.h"
#include "support.h"

namespace semblance::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

class SweepSurfaceCommand : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(path(name), std::ios::binary) << text;
  }
  ProgramResult run(const std::string& spec, std::vector<std::string> more = {}) const {
    write("sweep.json", spec);
    more.insert(more.begin(), {"sweep", "surface", path("sweep.json"), "-o", path("out.ply")});
    return run_program(more);
  }
  void expect_refused(const std::string& spec, const std::string& message) const {
    const ProgramResult result = run(spec);
    EXPECT_EQ(result.exit_code, 3) << result.output;
    EXPECT_THAT(result.output, HasSubstr(message));
    EXPECT_FALSE(fs::exists(path("out.ply")));
  }

 private:
  TemporaryFolder folder_;
};

// Two contours and one segment, with the second contour and the segment given.
std::string spec(const std::string& contour, const std::string& segment = "{}") {
  return R"({"schema": "semblance.sweep/1", "contours": [)"
         R"({"shape": "circle", "size_m": 0.2, "position": 0}, )" +
         contour + R"(], "segments": [)" + segment + "]}";
}
const char* const square = R"({"shape": "square", "size_m": 0.3, "position": 1})";

TEST_F(SweepSurfaceCommand, WritesTheMeshAndAPicture) {
  write("leaf.svg", "<svg><path d='M-3 0 Q0 4 3 0 Q0 -4 -3 0z'/></svg>");
  const ProgramResult result =
      run(spec(R"({"file": "leaf.svg", "metres_per_unit": 0.05, "position": 1})", R"({"n": 3})"),
          {"--around", "40", "--along", "10", "--caps", "--picture", path("out.png")});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  const Mesh mesh = read_ply(path("out.ply"));
  EXPECT_EQ(mesh.vertex_count(), 40 * 11 + 2);
  EXPECT_NEAR(mesh.positions_m.row(0).norm(), 0.2, 1e-6);
  EXPECT_NEAR(mesh.positions_m.col(1).maxCoeff(), 1.0, 1e-6);
  // The leaf is 0.3 m long on both sides of the middle.
  EXPECT_NEAR(mesh.positions_m.middleRows(400, 40).leftCols<1>().cwiseAbs().maxCoeff() +
                  mesh.positions_m.middleRows(400, 40).rightCols<1>().cwiseAbs().maxCoeff(),
              0.15 + 0.1, 2e-3);
  const Image picture = read_image(path("out.png"));
  EXPECT_EQ(picture.width, 640);
  float darkest = 1.0f;
  for (const float value : picture.data) darkest = std::min(darkest, value);
  EXPECT_LT(darkest, 0.5f);
}

TEST_F(SweepSurfaceCommand, RefusesWhatItCannotUse) {
  expect_refused("{", "sweep.json");
  expect_refused(R"({"schema": "semblance.track/1"})", "\"semblance.sweep/1\"");
  expect_refused(R"({"schema": "semblance.sweep/1"})", "contours: is missing");
  expect_refused(spec(square, R"({"n": -1})"), "segments[0].n: expected a number above -1");
  expect_refused(spec(square, R"({"n": -3.5})"), "not -3.5");
  expect_refused(spec(square, R"({"blend": "sharp"})"), "one of flat, rational");
  expect_refused(spec(square, R"({"m": 2})"), "unknown key 'm'");
  expect_refused(spec(R"({"shape": "square", "size_m": 0.3, "position": 0})"),
                 "contour 2 lies at 0");
  expect_refused(spec(R"({"shape": "star", "size_m": 0.3, "position": 1})"),
                 "circle, square, wave and ellipse");
  expect_refused(spec(R"({"position": 1})"), "either a 'shape' by name, or a 'file'");
  expect_refused(spec(R"({"file": "absent.csv", "position": 1})"), "absent.csv");
}

TEST_F(SweepSurfaceCommand, RefusesNamesItCannotWrite) {
  write("sweep.json", spec(square));
  for (const auto& [mesh, picture] :
       {std::pair{"out.stl", "out.png"}, std::pair{"out.ply", "out.tiff"}}) {
    const ProgramResult result = run_program(
        {"sweep", "surface", path("sweep.json"), "-o", path(mesh), "--picture", path(picture)});
    EXPECT_EQ(result.exit_code, 3) << result.output;
    EXPECT_FALSE(fs::exists(path(mesh)));
    EXPECT_FALSE(fs::exists(path(picture)));
  }
}

TEST_F(SweepSurfaceCommand, RefusesContoursThatAreNone) {
  const auto with_points = [&](const std::string& points, const std::string& message) {
    write("contour.csv", points);
    expect_refused(spec(R"({"file": "contour.csv", "position": 1})"), message);
  };
  with_points("", "contour.csv: the contour is empty");
  with_points("0 0\n1 inf\n0 1\n", "two finite numbers were expected");
  with_points("1 1\n-1 -1\n1 -1\n-1 1\n", "contour.csv: the contour crosses itself");
  with_points("1 0\n-1 0\n0 1\n0 -1\n0.5 0.5\n", "put the points in order");
  with_points("5 0\n6 0\n6 1\n", "every ray from its trajectory meets it once");
  const auto with_drawing = [&](const std::string& shape, const std::string& message) {
    write("contour.svg", "<svg>" + shape + "</svg>");
    expect_refused(spec(R"({"file": "contour.svg", "position": 1})"), message);
  };
  with_drawing("<rect width='100%' height='4'/>", "width is '100%'; a number without unit");
  with_drawing("<circle r='3mm'/>", "r is '3mm'");
  with_drawing("<rect width='4' height='4' rx='1'/>", "rounded corners");
  with_points("0 0\n1 1\n", "3 to 65536 different points");
}

TEST_F(SweepSurfaceCommand, WrongUsageIsSaidBeforeAnythingIsRead) {
  EXPECT_EQ(run(spec(square), {"--around", "2"}).exit_code, 2);
  EXPECT_EQ(run_program({"sweep"}).exit_code, 2);
  EXPECT_EQ(run_program({"sweep", "blends", "-o", path("b.svg"), "--form", "round"}).exit_code, 2);
}

TEST_F(SweepSurfaceCommand, BlendsAreDrawnForEveryN) {
  ASSERT_EQ(run_program({"sweep", "blends", "-o", path("b.svg"), "--n", "0", "4"}).exit_code, 0);
  const std::string svg = file_bytes(path("b.svg"));
  EXPECT_EQ(svg.find("<polyline", svg.find("<polyline", svg.find("<polyline") + 1) + 1),
            std::string::npos);
  // Both curves pass (0.5, R(0.5)): 1/2 for n = 0 and 5/6 for n = 4, on a side of 400 px.
  EXPECT_THAT(svg, AllOf(HasSubstr("246.0,246.0"), HasSubstr("246.0,112.7")));
  const ProgramResult low = run_program({"sweep", "blends", "-o", path("c.svg"), "--n", "-2"});
  EXPECT_EQ(low.exit_code, 3);
  EXPECT_THAT(low.output, HasSubstr("must exceed -1"));
  EXPECT_FALSE(fs::exists(path("c.svg")));
}

}  // namespace
}  // namespace semblance::testing
