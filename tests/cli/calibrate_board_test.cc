// `semblance calibrate board` and `rig` as a user runs them, on painted pictures of sheets.
#include <gmock/gmock.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>

#include "cameras/painted_sheet.h"
#include "program.h"
#include "semblance/io/camera_io.h"
#include "semblance/io/image_io.h"
#include "support.h"

namespace semblance::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr const char* kTarget = "chessboard:9x6:0.025";

class CalibrateBoard : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }

  /// Paints one picture of the sheet.
  std::string picture(const std::string& name, SheetView view, const char* target = kTarget) const {
    const PaintedSheet sheet(parse_target(target), view);
    write_bytes(path(name), encode_image(sheet.paint(7), ImageFormat::png));
    return path(name);
  }

  /// Ten pictures, tilted to all sides, of a camera with a focal length of 704 px.
  std::vector<std::string> pictures() const {
    std::vector<std::string> names;
    for (int i = 0; i < 10; ++i) {
      SheetView view;
      view.tilt_rad = i == 0 ? 0.0 : 0.35 + 0.02 * i;
      view.axis_rad = 2.0 * std::numbers::pi * i / 9.0;
      view.roll_rad = 0.1 * (i % 3 - 1);
      view.fill = 0.7;
      names.push_back(picture("view" + std::to_string(i) + ".png", view));
    }
    return names;
  }

  ProgramResult board(std::vector<std::string> files,
                      const std::vector<std::string>& options) const {
    files.insert(files.begin(), {"calibrate", "board"});
    files.insert(files.end(), {"-o", path("out")});
    files.insert(files.end(), options.begin(), options.end());
    return run_program(files);
  }

  static void write_bytes(const std::string& file, const std::vector<std::uint8_t>& bytes) {
    std::ofstream(file, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
  }

 private:
  TemporaryFolder folder_;
};

TEST_F(CalibrateBoard, FindsThePaintedCamera) {
  const ProgramResult result =
      board(pictures(), {"--target", kTarget, "--lens", "pinhole", "--json", path("summary.json")});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  const auto summary = nlohmann::json::parse(file_bytes(path("summary.json")));
  const Camera camera = read_camera(path("out/camera.json"));
  EXPECT_NEAR(camera.focal_px.x(), 704.0, 1.5);
  EXPECT_NEAR(camera.focal_px.y(), 704.0, 1.5);
  EXPECT_NEAR(camera.principal_px.x(), 320.0, 1.5);
  EXPECT_NEAR(camera.principal_px.y(), 240.0, 1.5);
  EXPECT_LT(summary["rms_px"], 0.1);
  EXPECT_EQ(summary["views"], 10);
  for (const char* key : {"focal_px", "principal_px", "outliers", "solve_s", "detect_s"}) {
    EXPECT_TRUE(summary.contains(key)) << key;
  }
  const std::string page = file_bytes(path("out/report.html"));
  EXPECT_THAT(page, AllOf(HasSubstr("views left out"), HasSubstr("<svg"), HasSubstr("view3.png")));
  EXPECT_THAT(page, Not(HasSubstr("src=\"http")));
  EXPECT_THAT(file_bytes(path("out/uncertainty_camera.svg")), HasSubstr("</svg>"));
}

TEST_F(CalibrateBoard, NamesThePictureThatDoesNotFit) {
  std::vector<std::string> files = pictures();
  SheetView stretched;  // another camera's picture of the same size
  stretched.tilt_rad = 0.5;
  stretched.distortion = -0.5;
  files.push_back(picture("other_camera.png", stretched));
  const ProgramResult result =
      board(files, {"--target", kTarget, "--lens", "pinhole", "--json", path("summary.json")});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output, HasSubstr("other_camera.png does not fit the other pictures"));
  const auto summary = nlohmann::json::parse(file_bytes(path("summary.json")));
  ASSERT_EQ(summary["outlier_views"].size(), 1u);
  EXPECT_NEAR(read_camera(path("out/camera.json")).focal_px.x(), 704.0, 1.5);
}

TEST_F(CalibrateBoard, PicturesOfTwoSizesAreNamed) {
  std::vector<std::string> files = pictures();
  SheetView portrait;
  portrait.width = 480;
  portrait.height = 640;
  files.push_back(picture("portrait.png", portrait));
  const ProgramResult result = board(files, {"--target", kTarget});
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(result.output, AllOf(HasSubstr("portrait.png"), HasSubstr("480 x 640")));
  EXPECT_FALSE(std::filesystem::exists(path("out")));
}

TEST_F(CalibrateBoard, TwoPicturesAreTooFew) {
  std::vector<std::string> files = pictures();
  files.resize(2);
  const ProgramResult result = board(files, {"--target", kTarget});
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(result.output, HasSubstr("3 are needed"));
}

TEST_F(CalibrateBoard, AnotherSheetIsNamed) {
  const ProgramResult result = board(pictures(), {"--target", "chessboard:7x5:0.03"});
  EXPECT_EQ(result.exit_code, 4);
  EXPECT_THAT(result.output, HasSubstr("chessboard:9x6"));
}

TEST_F(CalibrateBoard, AMirroredSheetIsRefused) {
  const char* target = "charuco:5x4:0.03:DICT_4X4_50";
  std::vector<std::string> files;
  for (int i = 0; i < 3; ++i) {
    SheetView view;
    view.tilt_rad = 0.4;
    view.axis_rad = 2.0 * i;
    const std::string name = picture("m" + std::to_string(i) + ".png", view, target);
    Rgb8 image = read_image_rgb8(name);
    for (int y = 0; y < image.height; ++y) {
      for (int x = 0; x < image.width / 2; ++x) {
        std::swap_ranges(&image.data[3 * (y * image.width + x)],
                         &image.data[3 * (y * image.width + x)] + 3,
                         &image.data[3 * (y * image.width + image.width - 1 - x)]);
      }
    }
    write_bytes(name, encode_image(image, ImageFormat::png));
    files.push_back(name);
  }
  const ProgramResult result = board(files, {"--target", target});
  EXPECT_NE(result.exit_code, 0);
  EXPECT_THAT(result.output, HasSubstr("mirror"));
}

TEST_F(CalibrateBoard, AnUnknownSizeIsSaid) {
  const ProgramResult result = board(pictures(), {"--target", "auto", "--lens", "pinhole"});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output, HasSubstr("the sheet's size is not known"));
}

TEST_F(CalibrateBoard, ARigNeedsKnownNames) {
  std::filesystem::create_directories(path("left"));
  std::filesystem::create_directories(path("right"));
  const ProgramResult result =
      run_program({"calibrate", "rig", path("left"), path("right"), "--target", kTarget, "-o",
                   path("out"), "--keep-pose", "middle"});
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(result.output, AllOf(HasSubstr("'middle'"), HasSubstr("left, right")));
}

}  // namespace
}  // namespace semblance::testing
