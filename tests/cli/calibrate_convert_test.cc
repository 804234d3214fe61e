// `semblance calibrate convert` as a user runs it.
#include <gmock/gmock.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "program.h"
#include "semblance/io/camera_io.h"
#include "semblance/io/camera_rig.h"
#include "support.h"

namespace semblance::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

class CalibrateConvert : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }
  ProgramResult convert(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), {"calibrate", "convert"});
    return run_program(arguments);
  }
  /// Two cameras in aniposelib's form, in millimetres.
  std::string calibration() const {
    const std::string rest =
        "size = [640, 480]\nmatrix = [[500.0, 0.0, 320.0], [0.0, 500.0, 240.0], [0.0, 0.0, 1.0]]\n"
        "distortions = [-0.1, 0.0, 0.0, 0.0, 0.5]\nrotation = [0.0, 0.0, 0.0]\n";
    std::ofstream(path("calibration.toml"))
        << "[cam_0]\nname = 'left'\ntranslation = [0.0, 0.0, 1000.0]\n"
        << rest << "[cam_1]\nname = 'right'\ntranslation = [-200.0, 0.0, 1000.0]\n"
        << rest;
    return path("calibration.toml");
  }

 private:
  TemporaryFolder folder_;
};

TEST_F(CalibrateConvert, SaysTheFormatsAndWritesARig) {
  const ProgramResult result = convert({calibration(), path("rig.json"), "--metres-per-unit",
                                        "0.001", "--json", path("summary.json")});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output,
              AllOf(HasSubstr("calibration.toml: read as aniposelib"),
                    HasSubstr("rig.json: written as semblance"), HasSubstr("rig.json: 2 cameras")));
  const CameraRig rig = read_rig(path("rig.json"));
  ASSERT_EQ(rig.cameras.size(), 2u);
  EXPECT_EQ(rig.cameras[1].name, "right");
  EXPECT_EQ(rig.cameras[1].principal_px, Eigen::Vector2d(320.5, 240.5));
  EXPECT_EQ(rig.cameras[1].camera_from_world.translation_m, Eigen::Vector3d(-0.2, 0, 1));
  const auto summary = nlohmann::json::parse(file_bytes(path("summary.json")));
  EXPECT_EQ(summary["from"], "aniposelib");
  EXPECT_EQ(summary["to"], "semblance");
  EXPECT_EQ(summary["cameras"][0]["lens"], "brown5");
}

TEST_F(CalibrateConvert, WritesOneOfSeveralCameras) {
  const ProgramResult result = convert({calibration(), path("right.json"), "--camera", "right"});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_EQ(read_camera(path("right.json")).name, "right");
  const ProgramResult none = convert({calibration(), path("x.json"), "--camera", "middle"});
  EXPECT_EQ(none.exit_code, 3);
  EXPECT_THAT(none.output, HasSubstr("it has 'left', 'right'"));
}

TEST_F(CalibrateConvert, RefusesALensThatTheFormatCannotHold) {
  const ProgramResult result = convert({calibration(), path("camchain.yaml")});
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(result.output, AllOf(HasSubstr("'left'"), HasSubstr("kalibr"), HasSubstr("brown5"),
                                   HasSubstr("write another format")));
  EXPECT_FALSE(fs::exists(path("camchain.yaml")));
}

TEST_F(CalibrateConvert, WrongUsageAndBadInputAreToldApart) {
  EXPECT_EQ(convert({calibration()}).exit_code, 2);
  const ProgramResult format = convert({calibration(), path("x.json"), "--from", "magic"});
  EXPECT_EQ(format.exit_code, 2);
  EXPECT_THAT(format.output, HasSubstr("kalibr"));
  EXPECT_EQ(convert({calibration(), path("x.json"), "--metres-per-unit", "-1"}).exit_code, 2);
  const ProgramResult name = convert({calibration(), path("x.csv")});
  EXPECT_EQ(name.exit_code, 3);
  EXPECT_THAT(name.output, HasSubstr("--to"));
  EXPECT_EQ(convert({path("absent.toml"), path("x.json")}).exit_code, 3);
  const ProgramResult forced = convert({calibration(), path("x.json"), "--from", "qualisys"});
  EXPECT_EQ(forced.exit_code, 3);
  EXPECT_THAT(forced.output, HasSubstr("not valid XML"));
  EXPECT_FALSE(fs::exists(path("x.json")));
}

}  // namespace
}  // namespace semblance::testing
