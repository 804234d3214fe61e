#include "semblance/io/camera_io.h"

#include <gmock/gmock.h>

#include "files.h"
#include "semblance/core/errors.h"
#include "support.h"

namespace semblance {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::TemporaryFolder;
using ::testing::ThrowsMessage;
using testing::write_text;

Camera some_camera() {
  Camera camera = Camera::centred(640, 480, 601.0 / 3.0);
  camera.name = "left \"eye\"";
  camera.focal_px.y() = 512.1;
  camera.lens = Lens::brown5;
  camera.distortion = {-0.1, 0.02, 1e-4, -2e-5, 1.0 / 7.0};
  camera.camera_from_world.rotation = Eigen::Quaterniond(0.1, -0.7, 0.3, 0.2).normalized();
  camera.camera_from_world.translation_m = Eigen::Vector3d(0.1, -1.0 / 3.0, 2.5);
  return camera;
}

TEST(CameraFile, KeepsEveryBit) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "camera.json";
  const Camera camera = some_camera();
  write_camera(path, camera);
  const Camera found = read_camera(path);
  EXPECT_EQ(found.name, camera.name);
  EXPECT_EQ(found.width, 640);
  EXPECT_EQ(found.height, 480);
  EXPECT_EQ(found.focal_px, camera.focal_px);
  EXPECT_EQ(found.principal_px, camera.principal_px);
  EXPECT_EQ(found.lens, camera.lens);
  EXPECT_EQ(found.distortion, camera.distortion);
  EXPECT_EQ(found.camera_from_world.rotation.coeffs(), camera.camera_from_world.rotation.coeffs());
  EXPECT_EQ(found.camera_from_world.translation_m, camera.camera_from_world.translation_m);
}

TEST(CameraFile, KeepsEveryLens) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "camera.json";
  for (const Lens lens : all_lenses) {
    Camera camera = some_camera();
    camera.lens = lens;
    camera.distortion = {};
    for (int i = 0; i < coefficient_count(lens); ++i) {
      camera.distortion[static_cast<std::size_t>(i)] = 0.1 / (i + 1);
    }
    write_camera(path, camera);
    const Camera found = read_camera(path);
    EXPECT_EQ(found.lens, lens);
    EXPECT_EQ(found.distortion, camera.distortion);
  }
}

constexpr const char* minimal =
    R"({"schema":"semblance.camera/1","width":4,"height":3,"focal_px":[5,6],"principal_px":[2,1.5]})";

TEST(CameraFile, NeedsOnlySizeAndLens) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "camera.json";
  write_text(path, minimal);
  const Camera camera = read_camera(path);
  EXPECT_EQ(camera.lens, Lens::pinhole);
  // Without a pose the camera stands at the origin and looks along the world's -z, y up.
  const Eigen::Vector2d above = project_world(camera, Eigen::Vector3d(0, 0.1, -1));
  EXPECT_NEAR(above.x(), 2.0, 1e-12);
  EXPECT_NEAR(above.y(), 1.5 - 0.6, 1e-12);
}

struct BadCamera {
  const char* name;
  const char* from;
  const char* to;
  const char* message;
};

class CameraFileRejects : public ::testing::TestWithParam<BadCamera> {};

TEST_P(CameraFileRejects, NamingFileAndKey) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "bad.json";
  std::string text = minimal;
  const std::string from = GetParam().from;
  const std::size_t at = text.find(from);
  ASSERT_NE(at, std::string::npos);
  write_text(path, text.replace(at, from.size(), GetParam().to));
  EXPECT_THAT([&] { read_camera(path); },
              ThrowsMessage<InvalidInput>(AllOf(HasSubstr(path), HasSubstr(GetParam().message))));
}

INSTANTIATE_TEST_SUITE_P(
    All, CameraFileRejects,
    ::testing::Values(
        BadCamera{"Nan", "[5,6]", "[NaN,6]", "no NaN"},
        BadCamera{"Null", "[5,6]", "[null,6]", "focal_px: expected 2 finite numbers"},
        BadCamera{"Infinite", "[5,6]", "[1e999,6]", "number is out of range"},
        BadCamera{"Short", "[5,6]", "[5]", "focal_px: expected 2"},
        BadCamera{"Negative", "[5,6]", "[-5,6]", "focal length"},
        BadCamera{"Missing", "\"width\":4,", "", "width: is missing"},
        BadCamera{"Unknown", "\"width\":4", "\"width\":4,\"widht\":4", "unknown key 'widht'"},
        BadCamera{"Twice", "\"width\":4", "\"width\":4,\"width\":5", "'width' is given twice"},
        BadCamera{"Size", "\"width\":4", "\"width\":0",
                  "width: expected a whole number from 1 to 65536"},
        BadCamera{"Fraction", "\"width\":4", "\"width\":4.5",
                  "width: expected a whole number from 1 to 65536"},
        BadCamera{"Huge", "\"width\":4", "\"width\":1000000000000",
                  "width: expected a whole number from 1 to 65536"},
        BadCamera{"Schema", "camera/1", "camera/2", "schema: expected \"semblance.camera/1\""},
        BadCamera{"Lens", "\"width\":4", "\"width\":4,\"lens\":\"fish\"",
                  "lens: expected one of pinhole"},
        BadCamera{"Distortion", "\"width\":4", "\"width\":4,\"lens\":\"brown5\"",
                  "distortion: is missing"},
        BadCamera{"PinholeDistortion", "\"width\":4", "\"width\":4,\"distortion\":[0,0,0,0,0]",
                  "unknown key 'distortion'"},
        BadCamera{"Rotation", "\"width\":4",
                  "\"width\":4,\"camera_from_world\":{\"rotation_wxyz\":[1,1,0,0],\"translation_"
                  "m\":[0,0,0]}",
                  "camera_from_world.rotation_wxyz: expected a unit"},
        BadCamera{"Translation", "\"width\":4",
                  "\"width\":4,\"camera_from_world\":{\"rotation_wxyz\":[1,0,0,0]}",
                  "camera_from_world.translation_m: is missing"},
        BadCamera{"Truncated", "[2,1.5]}", "[2,", "is not valid JSON at line 1, column"},
        BadCamera{"NoObject", minimal, "[1,2]", "expected a JSON object"}),
    [](const auto& test) { return std::string(test.param.name); });

TEST(CameraFile, ListsAllProblemsAtOnce) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "bad.json";
  write_text(path, R"({"schema":"semblance.camera/1","height":0,"focal_px":7,"x":1})");
  EXPECT_THAT([&] { read_camera(path); },
              ThrowsMessage<InvalidInput>(
                  AllOf(HasSubstr("width: is missing"), HasSubstr("height: expected"),
                        HasSubstr("focal_px: expected"), HasSubstr("principal_px: is missing"),
                        HasSubstr("unknown key 'x'"))));
}

TEST(CameraFile, ThatDoesNotExistIsAnIoError) {
  EXPECT_THAT([] { read_camera("/no/such/camera.json"); },
              ThrowsMessage<IoError>(HasSubstr("/no/such/camera.json: cannot be opened")));
}

}  // namespace
}  // namespace semblance
