// `semblance calibrate object` as a user runs it, on ray-traced pictures of a lump.
#include <gmock/gmock.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "object/object_scene.h"
#include "program.h"
#include "semblance/io/camera_io.h"
#include "semblance/io/camera_rig.h"
#include "semblance/io/image_io.h"
#include "semblance/io/marks_io.h"
#include "semblance/io/mesh_io.h"
#include "support.h"

namespace semblance::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class CalibrateObject : public ::testing::Test {
 protected:
  void SetUp() override {
    const ObjectScene scene(lump_mesh(64, 48), {}, {.textured = false, .mask = true});
    Random random(3);
    std::filesystem::create_directories(folder_.path() / "masks");
    MarksFile marks;
    for (int k = 0; k < 2; ++k) {
      poses_.push_back(random_pose(camera_, 0.24, 0.65, random));
      const ObjectPicture picture =
          scene.picture(camera_, poses_.back(), static_cast<std::uint64_t>(k + 1));
      const std::string name = "view" + std::to_string(k) + ".png";
      write_image(path(name), picture.linear);
      write_image(path("masks/" + name), picture.mask);
      MarksFile::Photo photo{name, {}};
      for (const ObjectPair& pair : picture.pairs) {
        const std::string point = name + pair.name;
        marks.points_m[point] = pair.point_m;
        photo.marks_px[point] = pair.pixel_px;
      }
      marks.photos.push_back(photo);
    }
    write_marks(path("marks.json"), marks);
    write_obj(path("lump.obj"), scene.mesh());
  }

  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }

  ProgramResult object(const std::vector<std::string>& options) const {
    std::vector<std::string> arguments = {
        "calibrate",      "object", path("view0.png"), path("view1.png"), "--mesh",
        path("lump.obj"), "-o",     path("out")};
    arguments.insert(arguments.end(), options.begin(), options.end());
    return run_program(arguments);
  }

  TemporaryFolder folder_;
  Camera camera_ = test_camera(600.0, 480, 360);
  std::vector<Rigid3> poses_;
};

TEST_F(CalibrateObject, FindsCameraAndPoses) {
  const ProgramResult result = object(
      {"--pairs", path("marks.json"), "--masks", path("masks"), "--json", path("summary.json")});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_NEAR(read_camera(path("out/camera.json")).focal_px.x(), 600.0, 15.0);
  const CameraRig rig = read_rig(path("out/rig.json"));
  ASSERT_EQ(rig.cameras.size(), 2u);
  EXPECT_EQ(rig.cameras[1].name, "view1");
  for (std::size_t k = 0; k < 2; ++k) {
    const Rigid3& found = rig.cameras[k].camera_from_world;
    EXPECT_LT(found.rotation.angularDistance(poses_[k].rotation), 0.02);
  }
  const auto summary = nlohmann::json::parse(file_bytes(path("summary.json")));
  for (const char* key : {"rms_px", "focal_px", "principal_px", "views", "outliers", "solve_s",
                          "outline_rms_px", "from_pairs", "pictures", "warnings"}) {
    EXPECT_TRUE(summary.contains(key)) << key;
  }
  EXPECT_LT(summary["outline_rms_px"], 1.0);
  EXPECT_EQ(read_image(path("out/overlay_view0.png")).width, 2 * 480);
  const std::string page = file_bytes(path("out/report.html"));
  EXPECT_THAT(page, AllOf(HasSubstr("view1.png"), HasSubstr("data:image/jpeg;base64,")));
  EXPECT_THAT(page, Not(HasSubstr("src=\"http")));
}

TEST_F(CalibrateObject, NamesWhatCannotBeUsed) {
  MarksFile marks = read_marks(path("marks.json"));
  marks.points_m.erase("view0.pngp3");
  write_marks(path("open.json"), marks);
  ProgramResult result = object({"--pairs", path("open.json")});
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(result.output, AllOf(HasSubstr("view0.pngp3"), HasSubstr("vertex:N")));

  marks = read_marks(path("marks.json"));
  marks.photos.pop_back();
  write_marks(path("less.json"), marks);
  result = object({"--pairs", path("less.json")});
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(result.output, AllOf(HasSubstr("no marks of"), HasSubstr("view1.png")));

  marks.photos[0].marks_px["vertex:999999"] = {10.0, 10.0};
  write_marks(path("vertex.json"), marks);
  result = object({"--pairs", path("vertex.json")});
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(result.output, HasSubstr("no such vertex"));

  std::filesystem::remove(path("masks/view1.png"));
  result = object({"--pairs", path("marks.json"), "--masks", path("masks")});
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(result.output, HasSubstr("there is no mask of"));

  EXPECT_EQ(object({}).exit_code, 2);
  EXPECT_EQ(object({"--pairs", path("marks.json"), "--pair-sigma", "-1"}).exit_code, 2);
  EXPECT_FALSE(std::filesystem::exists(path("out")));
}

TEST_F(CalibrateObject, TakesVerticesByTheirNumber) {
  const Mesh mesh = lump_mesh(64, 48);  // vertices in the order of the file
  MarksFile marks;
  for (int k = 0; k < 2; ++k) {
    MarksFile::Photo photo{"view" + std::to_string(k) + ".png", {}};
    for (const int vertex : {100, 700, 1300, 1900, 2500, 3000}) {
      const Eigen::Vector3d point = mesh.positions_m.row(vertex);
      photo.marks_px["vertex:" + std::to_string(vertex)] =
          project(camera_, poses_[static_cast<std::size_t>(k)] * point);
    }
    marks.photos.push_back(photo);
  }
  write_marks(path("vertices.json"), marks);
  const ProgramResult result = object({"--pairs", path("vertices.json"), "--pairs-only"});
  ASSERT_EQ(result.exit_code, 0) << result.output;
  EXPECT_NEAR(read_camera(path("out/camera.json")).focal_px.x(), 600.0, 0.01);
}

}  // namespace
}  // namespace semblance::testing
