// `semblance calibrate markers` as a user runs it, on painted pictures of a head with dots.
#include <gmock/gmock.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>

#include "cameras/painted_dots.h"
#include "program.h"
#include "semblance/io/camera_io.h"
#include "semblance/io/image_io.h"
#include "support.h"

namespace semblance::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class CalibrateMarkers : public ::testing::Test {
 protected:
  CalibrateMarkers() {
    Random random(12);
    object_ = dotted_head(random, 40);
    camera_ = Camera::centred(640, 480, 720.0);
    camera_.camera_from_world = {};
    write_marker_points(path("points.json"), object_.points(true));
  }

  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }

  std::string picture(const std::string& name, const Rigid3& pose) const {
    const auto bytes = encode_image(
        paint_dots(camera_, object_, pose, {}, std::hash<std::string>()(name)), ImageFormat::png);
    std::ofstream(path(name), std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
    return path(name);
  }

  std::vector<std::string> photos() const {
    std::vector<std::string> files;
    for (int i = 0; i < 6; ++i) {
      files.push_back(picture("photo" + std::to_string(i) + ".png",
                              view_of({0.4 * std::sin(1.3 * i), 1.0 * i, 0.1},
                                      {0.03 * std::sin(2.0 * i), 0.02 * std::cos(i), 0.36})));
    }
    return files;
  }

  ProgramResult markers(std::vector<std::string> files,
                        const std::vector<std::string>& options) const {
    files.insert(files.begin(), {"calibrate", "markers"});
    files.insert(files.end(), {"-o", path("out")});
    files.insert(files.end(), options.begin(), options.end());
    return run_program(files);
  }

  DottedObject object_;
  Camera camera_;

 private:
  TemporaryFolder folder_;
};

TEST_F(CalibrateMarkers, DotsAtKnownPlaces) {
  const ProgramResult result =
      markers(photos(), {"--points", path("points.json"), "--json", path("summary.json")});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  const auto summary = nlohmann::json::parse(file_bytes(path("summary.json")));
  EXPECT_NEAR(read_camera(path("out/camera.json")).focal_px.x(), 720.0, 7.0);
  EXPECT_EQ(summary["views"], 6);
  EXPECT_LT(summary["rms_px"], 0.15);
  for (const char* key : {"focal_px", "principal_px", "outliers", "solve_s", "detect_s"}) {
    EXPECT_TRUE(summary.contains(key)) << key;
  }
  const std::string page = file_bytes(path("out/report.html"));
  EXPECT_THAT(page, AllOf(HasSubstr("data:image/jpeg"), HasSubstr(">p1"), HasSubstr("photo3.png")));
  EXPECT_EQ(read_marker_points(path("out/points.json")).size(), object_.discs.size());
}

TEST_F(CalibrateMarkers, DotsAtUnknownPlaces) {
  std::filesystem::create_directories(path("clip"));
  constexpr int kFrames = 24;
  for (int i = 0; i < kFrames; ++i) {
    const double t = 2.0 * std::numbers::pi * i / kFrames;
    picture("clip/f" + std::to_string(100 + i) + ".png",
            view_of({0.4 * std::cos(t), 0.5 * std::sin(t), 0.0}, {0.01, 0.0, 0.36}));
  }
  const ProgramResult result = markers(
      {path("clip")}, {"--scale-unknown", "--lens", "pinhole", "--json", path("summary.json")});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output, HasSubstr("the scale is not known"));
  EXPECT_NEAR(read_camera(path("out/camera.json")).focal_px.x(), 720.0, 40.0);
  const std::vector<MarkerPoint> points = read_marker_points(path("out/points.json"));
  ASSERT_GE(points.size(), 10u);
  EXPECT_EQ(points[0].name, "d01");
  EXPECT_TRUE(points[0].sigma_m.has_value());
  EXPECT_THAT(file_bytes(path("out/report.html")), HasSubstr(">d01<"));
}

TEST_F(CalibrateMarkers, NothingFoundIsSaid) {
  object_.discs.clear();
  const ProgramResult result =
      markers({picture("bare.png", view_of({0.0, 0.0, 0.0}, {0.0, 0.0, 0.4}))},
              {"--points", path("points.json")});
  EXPECT_EQ(result.exit_code, 4);
  EXPECT_THAT(result.output, AllOf(HasSubstr("bare.png"), HasSubstr("no round dots")));
  EXPECT_FALSE(std::filesystem::exists(path("out")));
}

TEST_F(CalibrateMarkers, WrongUsage) {
  const std::string photo = picture("a.png", view_of({0.0, 0.0, 0.0}, {0.0, 0.0, 0.4}));
  EXPECT_EQ(markers({photo}, {}).exit_code, 2);
  EXPECT_EQ(markers({photo}, {"--length", "d01:d02"}).exit_code, 2);
  EXPECT_EQ(markers({photo}, {"--length", "d01:d02:-1"}).exit_code, 2);
  EXPECT_EQ(markers({photo}, {"--scale-unknown", "--points", path("points.json")}).exit_code, 2);
  EXPECT_EQ(markers({photo, photo}, {"--scale-unknown", "--rig"}).exit_code, 2);
  EXPECT_EQ(markers({photo}, {"--points", path("missing.json")}).exit_code, 3);
}

}  // namespace
}  // namespace semblance::testing
