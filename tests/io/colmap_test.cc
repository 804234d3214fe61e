#include "semblance/io/colmap.h"

#include <gmock/gmock.h>

#include <cmath>
#include <cstring>

#include "files.h"
#include "semblance/core/errors.h"
#include "semblance/io/camera_formats.h"
#include "some_rig.h"
#include "support.h"

namespace semblance {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::read_text;
using testing::some_rig;
using testing::TemporaryFolder;
using ::testing::ThrowsMessage;
using testing::write_text;

/// Two images of one camera, three 2D points each, one 3D point, and an unused camera.
ColmapModel small_model() {
  ColmapModel model;
  model.cameras[7] = {"SIMPLE_RADIAL", 640, 480, {601.25, 320.5, 240.25, -1.0 / 30.0}};
  model.cameras[9] = {"FULL_OPENCV", 65536, 1, std::vector<double>(12, 0.1)};
  const CameraRig rig = some_rig(Lens::pinhole);
  model.images[3] = {rig.cameras[0].camera_from_world,
                     7,
                     "a/left.png",
                     {{{1.0 / 3.0, 2.5}, 11}, {{3.0, 4.0}}, {{5.0, 6.0}}}};
  model.images[12] = {rig.cameras[1].camera_from_world,
                      7,
                      "right.png",
                      {{{7.0, 8.0}}, {{9.0, 1e-7}, 11}, {{-1.0, -2.0}}}};
  model.points[11] = {{0.1, -0.2, 1e10}, {0, 128, 255}, 0.25, {{3, 0}, {12, 1}}};
  return model;
}

void expect_equal(const ColmapModel& a, const ColmapModel& b) {
  ASSERT_EQ(a.cameras.size(), b.cameras.size());
  for (const auto& [id, camera] : a.cameras) {
    const ColmapModel::Intrinsics& other = b.cameras.at(id);
    EXPECT_EQ(camera.model, other.model);
    EXPECT_EQ(camera.width, other.width);
    EXPECT_EQ(camera.height, other.height);
    EXPECT_EQ(camera.parameters, other.parameters);
  }
  ASSERT_EQ(a.images.size(), b.images.size());
  for (const auto& [id, image] : a.images) {
    const ColmapModel::Image& other = b.images.at(id);
    EXPECT_EQ(image.name, other.name);
    EXPECT_EQ(image.camera, other.camera);
    EXPECT_EQ(image.camera_from_world.rotation.coeffs(), other.camera_from_world.rotation.coeffs());
    EXPECT_EQ(image.camera_from_world.translation_m, other.camera_from_world.translation_m);
    ASSERT_EQ(image.observations.size(), other.observations.size());
    for (std::size_t i = 0; i < image.observations.size(); ++i) {
      EXPECT_EQ(image.observations[i].pixel, other.observations[i].pixel);
      EXPECT_EQ(image.observations[i].point, other.observations[i].point);
    }
  }
  ASSERT_EQ(a.points.size(), b.points.size());
  for (const auto& [id, point] : a.points) {
    const ColmapModel::Point& other = b.points.at(id);
    EXPECT_EQ(point.position, other.position);
    EXPECT_EQ(point.colour, other.colour);
    EXPECT_EQ(point.error_px, other.error_px);
    ASSERT_EQ(point.track.size(), other.track.size());
    for (std::size_t i = 0; i < point.track.size(); ++i) {
      EXPECT_EQ(point.track[i].image, other.track[i].image);
      EXPECT_EQ(point.track[i].observation, other.track[i].observation);
    }
  }
}

class Colmap : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }
  std::string complaint() const {
    try {
      read_colmap(path("model"));
    } catch (const InvalidInput& error) {
      return error.what();
    }
    return "no complaint";
  }

 private:
  TemporaryFolder folder_;
};

TEST_F(Colmap, TextAndBinaryKeepEveryBit) {
  const ColmapModel model = small_model();
  write_colmap_text(path("text"), model);
  expect_equal(read_colmap(path("text")), model);
  write_colmap_binary(path("binary"), model);
  expect_equal(read_colmap(path("binary")), model);
}

TEST_F(Colmap, PointsSurviveTheWayThroughTheFormats) {
  const ColmapModel model = small_model();
  write_colmap_text(path("text"), model);
  const CameraFile file = read_cameras(path("text"), recognise_camera_file(path("text")));
  EXPECT_EQ(file.rig.cameras.at(1).name, "right.png");
  write_cameras(path("binary"), file, *find_camera_format("colmap-binary"));
  expect_equal(read_colmap(path("binary")), model);
  EXPECT_THAT(write_cameras(path("rig.json"), file, *find_camera_format("semblance")),
              ::testing::Contains(HasSubstr("not kept: COLMAP's 2D points and 1 3D points")));
  const CameraFile larger = read_cameras(path("text"), *find_camera_format("colmap-text"), 2.0);
  EXPECT_EQ(larger.model->points.at(11).position, 2.0 * model.points.at(11).position);
  EXPECT_EQ(larger.rig.cameras[0].camera_from_world.translation_m,
            larger.model->images.at(3).camera_from_world.translation_m);
}

TEST_F(Colmap, ReadsTextAsColmapWritesIt) {
  std::filesystem::create_directory(path("model"));
  write_text(path("model") + "/cameras.txt",
             "# Camera list with one line of data per camera:\n"
             "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n# Number of cameras: 1\n"
             "1 SIMPLE_PINHOLE 3072 2304 2559.81 1536 1152\n");
  write_text(path("model") + "/images.txt",
             "# Number of images: 2, mean observations per image: 1\n"
             "1 0.851773 0.0165051 0.503764 -0.142941 -0.737434 1.02973 3.74354 1 P1180141.JPG\n"
             "2362.39 248.498 58396 1784.7 268.254 -1\n"
             "2 0.851773 0.0165051 0.503764 -0.142941 -0.737434 1.02973 3.74354 1 P1180142.JPG\n"
             "\n");
  write_text(path("model") + "/points3D.txt",
             "58396 1.67241 0.292931 0.609726 115 121 122 1.33927 1 0\n");
  const ColmapModel model = read_colmap(path("model"));
  EXPECT_EQ(model.images.at(1).observations[0].point, 58396u);
  EXPECT_EQ(model.images.at(1).observations[1].point, ColmapModel::no_point);
  EXPECT_TRUE(model.images.at(2).observations.empty());
  EXPECT_EQ(model.points.at(58396).colour[2], 122);
  EXPECT_NEAR(model.images.at(1).camera_from_world.rotation.norm(), 1.0, 1e-15);
  const Camera camera = rig_from_colmap(model).cameras.at(0);
  EXPECT_EQ(camera.principal_px, Eigen::Vector2d(1536, 1152));  // as it is: no half pixel
  EXPECT_EQ(camera.focal_px, Eigen::Vector2d(2559.81, 2559.81));
}

// COLMAP's own formulas, src/base/camera_models.h, in pixels.
Eigen::Vector2d colmap_pixel(const ColmapModel::Intrinsics& camera, double u, double v) {
  const std::vector<double>& p = camera.parameters;
  const double r2 = u * u + v * v, r = std::sqrt(r2), r4 = r2 * r2, r6 = r4 * r2;
  if (camera.model == "SIMPLE_PINHOLE") return {p[0] * u + p[1], p[0] * v + p[2]};
  if (camera.model == "PINHOLE") return {p[0] * u + p[2], p[1] * v + p[3]};
  if (camera.model == "SIMPLE_RADIAL" || camera.model == "RADIAL") {
    const double k2 = camera.model == "RADIAL" ? p[4] : 0.0;
    const double radial = 1.0 + p[3] * r2 + k2 * r4;
    return {p[0] * u * radial + p[1], p[0] * v * radial + p[2]};
  }
  if (camera.model == "OPENCV_FISHEYE") {
    const double t = std::atan(r), t2 = t * t;
    const double scale =
        t * (1 + p[4] * t2 + p[5] * t2 * t2 + p[6] * std::pow(t, 6) + p[7] * std::pow(t, 8)) / r;
    return {p[0] * u * scale + p[2], p[1] * v * scale + p[3]};
  }
  const bool full = camera.model == "FULL_OPENCV";
  const double radial =
      full ? (1 + p[4] * r2 + p[5] * r4 + p[8] * r6) / (1 + p[9] * r2 + p[10] * r4 + p[11] * r6)
           : 1 + p[4] * r2 + p[5] * r4;
  const double x = u * radial + 2 * p[6] * u * v + p[7] * (r2 + 2 * u * u);
  const double y = v * radial + 2 * p[7] * u * v + p[6] * (r2 + 2 * v * v);
  return {p[0] * x + p[2], p[1] * y + p[3]};
}

TEST_F(Colmap, CameraModelsProjectAsColmapDoes) {
  const std::vector<ColmapModel::Intrinsics> cameras{
      {"SIMPLE_PINHOLE", 64, 48, {50, 31, 23}},
      {"PINHOLE", 64, 48, {50, 51, 31, 23}},
      {"SIMPLE_RADIAL", 64, 48, {50, 31, 23, -0.1}},
      {"RADIAL", 64, 48, {50, 31, 23, -0.1, 0.02}},
      {"OPENCV", 64, 48, {50, 51, 31, 23, -0.1, 0.02, 0.003, -0.004}},
      {"OPENCV_FISHEYE", 64, 48, {50, 51, 31, 23, -0.1, 0.02, 0.003, -0.004}},
      {"FULL_OPENCV", 64, 48, {50, 51, 31, 23, -0.1, 0.02, 0.003, -0.004, 0.01, 0.2, 0.03, 0.004}}};
  for (const ColmapModel::Intrinsics& given : cameras) {
    ColmapModel model;
    model.cameras[1] = given;
    model.images[1] = {{}, 1, "x", {}};
    const Camera camera = rig_from_colmap(model).cameras.at(0);
    const ColmapModel again = colmap_from_rig({{camera}});
    for (const double u : {-0.4, 0.1, 0.3}) {
      for (const double v : {-0.2, 0.25}) {
        const Eigen::Vector2d expected = colmap_pixel(given, u, v);
        EXPECT_LT((project(camera, {2 * u, 2 * v, 2}) - expected).norm(), 1e-12) << given.model;
        EXPECT_LT((colmap_pixel(again.cameras.at(1), u, v) - expected).norm(), 1e-12)
            << given.model;
      }
    }
  }
}

TEST_F(Colmap, AnyCutBinaryFileIsRefused) {
  write_colmap_binary(path("model"), small_model());
  for (const char* name : {"cameras", "images", "points3D"}) {
    const std::string file = path("model") + "/" + name + ".bin";
    const std::string whole = read_text(file);
    for (std::size_t size = 0; size < whole.size(); ++size) {
      write_text(file, whole.substr(0, size));
      ASSERT_THAT(complaint(), AllOf(HasSubstr(std::string(name) + ".bin"), HasSubstr("byte")))
          << size;
    }
    write_text(file, whole + "x");
    EXPECT_THAT(complaint(), HasSubstr("left over"));
    write_text(file, whole);
  }
}

TEST_F(Colmap, CountsAreNotBelieved) {
  write_colmap_binary(path("model"), small_model());
  for (const char* name : {"cameras", "images", "points3D"}) {
    const std::string file = path("model") + "/" + name + ".bin";
    const std::string whole = read_text(file);
    std::string lie = whole;
    const std::uint64_t count = 1ull << 60;
    std::memcpy(lie.data(), &count, 8);
    write_text(file, lie);
    EXPECT_THAT(complaint(), HasSubstr("longer than the file"));
    write_text(file, whole);
  }
}

TEST_F(Colmap, BadTextNamesFileAndLine) {
  const auto complaint_of = [&](const std::string& name, const std::string& from,
                                const std::string& to) {
    write_colmap_text(path("model"), small_model());
    const std::string file = path("model") + "/" + name + ".txt";
    std::string text = read_text(file);
    write_text(file, text.replace(text.find(from), from.size(), to));
    return complaint();
  };
  EXPECT_THAT(complaint_of("cameras", "SIMPLE_RADIAL", "FOV"),
              AllOf(HasSubstr("cameras.txt, line 2"), HasSubstr("OPENCV_FISHEYE")));
  EXPECT_THAT(complaint_of("cameras", "640", "0"), HasSubstr("1 to 65536 pixels"));
  EXPECT_THAT(complaint_of("cameras", "601.25", "nan"), HasSubstr("a finite number"));
  EXPECT_THAT(complaint_of("cameras", "601.25", "601.25 1"), HasSubstr("4 parameters and no more"));
  EXPECT_THAT(complaint_of("cameras", "\n9", "\n7"), HasSubstr("each CAMERA_ID once"));
  EXPECT_THAT(complaint_of("images", "right.png", "right eye.png"),
              AllOf(HasSubstr("images.txt, line 5"), HasSubstr("without blanks")));
  EXPECT_THAT(complaint_of("images", "2.5 11", "2.5 12"), HasSubstr("3D point 12"));
  EXPECT_THAT(complaint_of("images", "7 a/left", "8 a/left"), HasSubstr("camera 8"));
  EXPECT_THAT(complaint_of("points3D", "255", "256"), HasSubstr("colours from 0 to 255"));
  EXPECT_THAT(complaint_of("points3D", "3 0", "3 9"), HasSubstr("2D point 9 of image 3"));
  EXPECT_THAT(complaint_of("points3D", "3 0", "3"), HasSubstr("POINT2D_IDX"));
}

TEST_F(Colmap, NamesHaveNoZeroByte) {
  ColmapModel model = small_model();
  model.images[3].name = std::string("a\0b", 3);
  EXPECT_THAT([&] { write_colmap_binary(path("model"), model); },
              ThrowsMessage<InvalidInput>(AllOf(HasSubstr("image 3"), HasSubstr("zero byte"))));
  EXPECT_THROW(validate(model, "model"), InvalidInput);
  EXPECT_FALSE(std::filesystem::exists(path("model")));
}

TEST_F(Colmap, NamesWithBlanksNeedBinary) {
  CameraRig rig = some_rig(Lens::pinhole);
  rig.cameras[0].name = "left eye";
  const CameraFile file{.rig = rig};
  EXPECT_THAT(
      [&] { write_cameras(path("t"), file, *find_camera_format("colmap-text")); },
      ThrowsMessage<InvalidInput>(AllOf(HasSubstr("'left eye'"), HasSubstr("colmap-binary"))));
  EXPECT_FALSE(std::filesystem::exists(path("t")));
  write_cameras(path("b"), file, *find_camera_format("colmap-binary"));
  EXPECT_EQ(read_colmap(path("b")).images.at(1).name, "left eye");
}

}  // namespace
}  // namespace semblance
