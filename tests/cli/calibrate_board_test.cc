// `semblance calibrate board` and `rig` as a user runs them, on painted pictures of sheets.
#include <gmock/gmock.h>

#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>

#include "cameras/painted_sheet.h"
#include "program.h"
#include "semblance/io/camera_io.h"
#include "semblance/io/camera_rig.h"
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

  /// Eight views by two cameras in folders `left` and `right`. The right one is turned about its
  /// axis and stands further back by `distance_m`.
  void rig_pictures(int count = 8) const {
    for (int i = 0; i < count; ++i) {
      SheetView view;
      view.tilt_rad = i == 0 ? 0.1 : 0.35 + 0.02 * i;
      view.axis_rad = 2.0 * std::numbers::pi * i / 7.0;
      view.fill = 0.7;
      const std::string name = std::to_string(i) + ".png";
      std::filesystem::create_directories(path("left"));
      std::filesystem::create_directories(path("right"));
      picture("left/" + name, view);
      view.axis_rad += kRightRoll_rad;
      view.roll_rad += kRightRoll_rad;
      view.fill = kRightFill;
      picture("right/" + name, view);
    }
  }

  static double distance_m() {
    const BlackRectangle box = sheet_shapes(parse_target(kTarget)).bounds();
    const double extent_m = (box.upper_m - box.lower_m).maxCoeff();
    return 704.0 * extent_m / 480.0 * (1.0 / kRightFill - 1.0 / 0.7);
  }

  /// What is known of the two cameras, in a file of its own each.
  std::vector<std::string> intrinsics(int width, int height, double focal_px = 704.0) const {
    std::vector<std::string> files;
    for (const char* name : {"left", "right"}) {
      Camera camera = Camera::centred(width, height, focal_px);
      camera.name = name;
      files.push_back(path(std::string(name) + ".json"));
      write_camera(files.back(), camera);
    }
    return files;
  }

  ProgramResult rig(const std::vector<std::string>& options) const {
    std::vector<std::string> arguments = {"calibrate", "rig"};
    arguments.insert(arguments.end(), {path("left"), path("right"), "--target", kTarget, "--lens",
                                       "pinhole", "-o", path("out")});
    arguments.insert(arguments.end(), options.begin(), options.end());
    return run_program(arguments);
  }

  static void write_bytes(const std::string& file, const std::vector<std::uint8_t>& bytes) {
    std::ofstream(file, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
  }

 private:
  static constexpr double kRightRoll_rad = 0.3, kRightFill = 0.55;
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

TEST_F(CalibrateBoard, JudgeTellsAStoredCameraFromAChangedOne) {
  const auto judged = [&](double focal_px) {
    Camera stored = Camera::centred(640, 480, focal_px);
    stored.name = "stored";
    write_camera(path("stored.json"), stored);
    std::vector<std::string> arguments = pictures();
    arguments.insert(arguments.begin(), {"calibrate", "judge"});
    arguments.insert(arguments.end(),
                     {"--cameras", path("stored.json"), "--target", kTarget, "--lens", "pinhole",
                      "-o", path("out"), "--json", path("summary.json")});
    const ProgramResult result = run_program(arguments);
    EXPECT_EQ(result.exit_code, 0) << result.output;
    return nlohmann::json::parse(file_bytes(path("summary.json")));
  };
  const auto same = judged(704.0), zoomed = judged(715.0);
  EXPECT_FALSE(same["changed"]) << same;
  EXPECT_LT(same["cameras"][0]["rms_px"], 0.1);
  EXPECT_TRUE(zoomed["changed"]);
  EXPECT_GT(zoomed["cameras"][0]["lens_change_px"],
            3.0 * zoomed["cameras"][0]["lens_change_sigma_px"].get<double>());
  EXPECT_THAT(zoomed["warnings"].dump(), HasSubstr("stored"));
  EXPECT_THAT(file_bytes(path("out/report.html")), HasSubstr("Warnings"));
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

TEST_F(CalibrateBoard, ARigKnowsItsCamerasFromFiles) {
  rig_pictures();
  std::vector<std::string> options = {"--keep-intrinsics", "all", "--intrinsics"};
  for (const std::string& file : intrinsics(640, 480)) options.push_back(file);
  const ProgramResult result = rig(options);
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output, Not(HasSubstr("blocks of 16")));
  const std::vector<Camera> found = read_rig(path("out/rig.json")).cameras;
  const Rigid3 right_from_left = found[1].camera_from_world * found[0].camera_from_world.inverse();
  EXPECT_NEAR(right_from_left.translation_m.z(), distance_m(), 1e-3);
  EXPECT_LT(right_from_left.translation_m.head<2>().norm(), 1e-3);
  EXPECT_EQ(found[1].focal_px.x(), 704.0);
}

TEST_F(CalibrateBoard, OnePicturePerCameraGivesTheirPlaces) {
  rig_pictures(1);
  const std::vector<std::string> files = intrinsics(640, 480);
  const ProgramResult result =
      run_program({"calibrate", "rig", path("left/0.png"), path("right/0.png"), "--names",
                   "left,right", "--target", kTarget, "--intrinsics", files[0], files[1],
                   "--keep-intrinsics", "all", "-o", path("out")});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  const std::vector<Camera> found = read_rig(path("out/rig.json")).cameras;
  const Rigid3 right_from_left = found[1].camera_from_world * found[0].camera_from_world.inverse();
  EXPECT_NEAR(right_from_left.translation_m.norm(), distance_m(), 4e-3);
}

TEST_F(CalibrateBoard, NamesAreOnePerCamera) {
  rig_pictures(1);
  const ProgramResult result = rig({"--names", "a,b,c"});
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(result.output, HasSubstr("3 names for 2 cameras"));
}

TEST_F(CalibrateBoard, ACalibrationOfAnotherSizeIsNamed) {
  rig_pictures(1);
  const std::map<std::pair<int, int>, std::string> reasons = {{{480, 640}, "lies on its side"},
                                                              {{1280, 960}, "the scale is not"},
                                                              {{800, 600}, "scale"},
                                                              {{1024, 576}, "one size alone"}};
  for (const auto& [size, reason] : reasons) {
    std::vector<std::string> options = {"--intrinsics"};
    for (const std::string& file : intrinsics(size.first, size.second)) options.push_back(file);
    const ProgramResult result = rig(options);
    EXPECT_EQ(result.exit_code, 3);
    EXPECT_THAT(result.output, AllOf(HasSubstr(path("left")), HasSubstr("640 x 480"),
                                     HasSubstr("'left'"), HasSubstr(reason)));
    EXPECT_FALSE(std::filesystem::exists(path("out")));
  }
}

TEST_F(CalibrateBoard, TheFillingOfEncodersIsNamed) {
  rig_pictures();
  std::vector<std::string> options = {"--keep-intrinsics", "all", "--json", path("summary.json"),
                                      "--intrinsics"};
  for (const std::string& file : intrinsics(640, 470)) options.push_back(file);  // 480 = 30 x 16
  const ProgramResult result = rig(options);
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output, AllOf(HasSubstr("640 x 470"), HasSubstr("blocks of 16 pixels")));
  const auto summary = nlohmann::json::parse(file_bytes(path("summary.json")));
  EXPECT_THAT(summary["warnings"].dump(), HasSubstr("blocks of 16 pixels"));
  EXPECT_EQ(read_rig(path("out/rig.json")).cameras[0].height, 480);
}

TEST_F(CalibrateBoard, AMeasuredDistanceChecksTheSheet) {
  rig_pictures();
  const auto measured = [&](double times) {
    return "left:right:" + std::to_string(times * distance_m());
  };
  const ProgramResult right = rig({"--distance", measured(1.0)});
  ASSERT_EQ(right.exit_code, 0) << right.output;
  EXPECT_THAT(right.output, Not(HasSubstr("you measured")));
  const ProgramResult wrong = rig({"--distance", measured(1.2)});
  ASSERT_EQ(wrong.exit_code, 0) << wrong.output;
  EXPECT_THAT(wrong.output, AllOf(HasSubstr("from left to right you measured"), HasSubstr(kTarget),
                                  HasSubstr("the sheet is chessboard:9x6:0.03")));
  EXPECT_EQ(rig({"--distance", "left:right"}).exit_code, 2);
  const ProgramResult unknown = rig({"--distance", "left:middle:0.3"});
  EXPECT_EQ(unknown.exit_code, 3);
  EXPECT_THAT(unknown.output, HasSubstr("left, right"));
}

TEST_F(CalibrateBoard, AMeasuredSheetIsCompared) {
  // Eight squares of 25 mm, which turned out to be 30 mm.
  const ProgramResult result =
      board(pictures(), {"--target", kTarget, "--lens", "pinhole", "--distance", "0:8:0.24"});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output,
              AllOf(HasSubstr("you measured 0.24 m"), HasSubstr("chessboard:9x6:0.03")));
}

TEST_F(CalibrateBoard, ARotatedVideoIsTakenUpright) {
  // Upright pictures of a camera whose principal point is not in the middle, stored lying on their
  // left side, with the matrix that turns them upright for display.
  constexpr double right_px = 14.0, down_px = -22.0;
  VideoWriter video(path("phone.mp4"), 640, 480, 10.0);
  for (int i = 0; i < 10; ++i) {
    SheetView view;
    view.tilt_rad = i == 0 ? 0.0 : 0.35 + 0.02 * i;
    view.axis_rad = 2.0 * std::numbers::pi * i / 9.0;
    view.width = 480;
    view.height = 640;
    view.fill = 0.8;
    view.shift_px = {right_px, down_px};
    const Rgb8 upright = PaintedSheet(parse_target(kTarget), view).paint(3);
    Rgb8 lying{640, 480, std::vector<std::uint8_t>(upright.data.size())};
    for (int y = 0; y < upright.height; ++y) {
      for (int x = 0; x < upright.width; ++x) {
        std::copy_n(&upright.data[3 * (y * upright.width + x)], 3,
                    &lying.data[3 * ((upright.width - 1 - x) * lying.width + y)]);
      }
    }
    video.write(lying);
  }
  video.close();
  std::string bytes = file_bytes(path("phone.mp4"));
  // ISO/IEC 14496-12 8.3.2: the matrix of a track header of version 0, 16.16 fixed point.
  const std::size_t matrix = bytes.find("tkhd") + 44;
  const char quarter_turn[] = "\0\0\0\0\0\1\0\0\0\0\0\0\xff\xff\0\0\0\0\0\0\0\0\0\0";
  bytes.replace(matrix, 24, quarter_turn, 24);
  write_bytes(path("phone.mp4"), {bytes.begin(), bytes.end()});
  const ProgramResult result =
      board({path("phone.mp4")}, {"--target", kTarget, "--lens", "pinhole"});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  const Camera camera = read_camera(path("out/camera.json"));
  EXPECT_EQ(camera.width, 480);
  EXPECT_EQ(camera.height, 640);
  EXPECT_NEAR(camera.focal_px.x(), 1.1 * 480, 2.0);
  EXPECT_NEAR(camera.principal_px.x(), 240.0 + right_px, 3.0);
  EXPECT_NEAR(camera.principal_px.y(), 320.0 + down_px, 3.0);
}

}  // namespace
}  // namespace semblance::testing
